"""The README's blocks behind the first hour, in order, each on what the blocks before it left.

A line of the README that is neither run here nor named in ELSEWHERE fails the test, so nobody can
add one that is not thought of.
"""

import re
import shlex
from pathlib import Path

import pytest
from klab import ALONE, SHORT_RUNS, klab

README = Path(__file__).parents[2] / "README.md"
BEHIND = README.read_text().partition("\n## What a person does here\n")[2]
LINES = [
    words
    for block in re.findall(r"^```bash\n(.*?)^```", BEHIND, re.M | re.S)
    for line in block.splitlines()
    if (words := shlex.split(line, comments=True))
]

SHORTER = {
    "klab calibrate --robot kinematic": ("--segments", "8", *SHORT_RUNS),
    "klab calibrate --robot dynamic --lockstep --segments 30 --seed 3": (
        *("--segments", "3", *SHORT_RUNS),
    ),
    "klab calibrate --robot dynamic --lockstep": ("--segments", "20", *SHORT_RUNS),
    "klab calibrate --lockstep": ("--segments", "2", *SHORT_RUNS),
    "klab reference": ("--runs", "2"),
    "klab park --model": ("--set", "controller.horizon=25"),
    "klab compare": ("--set", "controller.horizon=10", "--set", "controller.time_limit_s=1"),
    "klab simulate": ("--set", "controller.horizon=10", "--duration", "1"),
    "klab bench lockstep": ("--seconds", "2"),
}
"""What the test adds to a command that begins so: the same command, on less."""

NO_BUS = ("klab simulate", "klab bench motor", "klab bench lockstep")
"""Commands that need no bus and no other process, beside those of ALONE."""

ELSEWHERE = {
    "waits for a lab, a bus or Ctrl-C; run by tests/console/test_readme_live.py": (
        *("klab up", "klab estop", "klab goal", "klab status", "klab down", "klab run"),
        *("klab view", "klab topics", "klab fault", "klab replay", "lcm-logplayer"),
        "klab calibrate --robot-name",
    ),
    "trained from the log of a replay, there too": ("klab train runs/replay",),
    "a cost that need not park the robot in time: tests/console/test_lab_runs.py": (
        "klab park --robot dynamic --model runs/dynamic.npz --cost ce",
    ),
    "not shortened yet, or asks more than a short session has: tests/console, tests/studies": (
        *("klab bench view", "klab bench faults", "klab bench realtime", "klab bench ocp"),
        *("klab bench parks", "klab bench logger", "klab bench dataset", "klab bench edmd"),
        *("klab bench stop", "klab study", "klab reproduce", "klab dataset needed"),
    ),
    "would run this test within itself, or needs a screen or a whole reproduction": ("./scripts/",),
}
"""The beginnings of lines that are only parsed, by test_readme, under the reason."""


def begins(line: str, with_any) -> bool:
    return any(line.startswith(beginning) for beginning in with_any)


def is_run(words: list[str]) -> bool:
    """Return whether a line is run here; fail where no table knows it."""
    line = " ".join(words)
    if begins(line, [b for beginnings in ELSEWHERE.values() for b in beginnings]):
        return False
    alone = words[0] == "klab" and (words[1] in ALONE or "--lockstep" in words)
    known = alone or begins(line, NO_BUS)
    assert known, f"README: nothing runs `{line}`: run it here, or say in ELSEWHERE what does"
    return True


def test_each_line_is_run_or_named():
    assert [words for words in LINES if is_run(words)]


@pytest.mark.parametrize("table", [SHORTER, *([b] for bs in ELSEWHERE.values() for b in bs)])
def test_no_table_names_what_is_not_there(table):
    for beginning in table:
        assert any(begins(" ".join(words), [beginning]) for words in LINES), beginning


def test_each_line_does_its_job_on_what_those_before_it_left(tmp_path):
    (tmp_path / "runs").mkdir()
    for words in filter(is_run, LINES):
        line = " ".join(words)
        added = [o for beginning, o in SHORTER.items() if line.startswith(beginning)]
        done = klab(*words[1:], *(added[0] if added else ()), cwd=tmp_path)
        assert done.returncode == 0, f"{line}\n{done.stderr}"
        for at in (k + 1 for k, word in enumerate(words) if word == "--out"):
            made = tmp_path / words[at]
            assert made.exists() or list(made.parent.glob(f"{made.name}*")), line

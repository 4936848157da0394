"""The README's blocks behind the first hour, in order, each on what the blocks before it left.

A line of the README that is neither run here nor named in ELSEWHERE fails the test, so nobody can
add one that is not thought of.
"""

import pytest
from klab import ALONE, SHORT_RUNS, klab
from terminals import LATER

ONE_RUN = ("--runs", "1", "--workers", "1")
NEAR = ("--set", "controller.horizon=5")
MANY = ("kinematic-parking", "dynamic-parking", "data-efficiency", "combination", "fit")
UNCOMPILED = (
    *(f"klab study {name}" for name in MANY),
    *("klab study weights", "klab compare", "klab simulate"),
)
"""Of many problems: to compile each takes longer than to solve it a few times without."""

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
    "klab study weights": ("--factors", "1", "--duration", "1"),
    **{f"klab study {name}": (*ONE_RUN, *NEAR) for name in MANY},
    "klab study horizon": ONE_RUN,
}
"""What the test adds to a command that begins so: the same command, on less."""

NO_BUS = (
    *("klab simulate", "klab study", "klab bench motor", "klab bench lockstep"),
    "klab bench dataset",
)
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
    "on less, with what it prints looked at: tests/console/test_bench.py, test_fault_table.py": (
        *("klab bench faults", "klab bench realtime", "klab bench ocp", "klab bench parks"),
        *("klab bench logger", "klab bench edmd", "klab bench view"),
    ),
    "in a browser: tests/browser/test_bench_stop.py": ("klab bench stop",),
    "on a cluster: tests/studies/test_study_survives.py": (
        "klab study dynamic-parking --model runs/dynamic.npz --dask",
    ),
    "asks for longer runs than a short session has: tests/koopman/test_needed.py": (
        "klab dataset needed",
    ),
    "minutes at its shortest; its steps one by one: tests/console/test_reproduce.py": (
        "klab reproduce",
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
    assert [words for words in LATER if is_run(words)]


@pytest.mark.parametrize("table", [SHORTER, *([b] for bs in ELSEWHERE.values() for b in bs)])
def test_no_table_names_what_is_not_there(table):
    for beginning in table:
        assert any(begins(" ".join(words), [beginning]) for words in LATER), beginning


def test_each_line_does_its_job_on_what_those_before_it_left(tmp_path, monkeypatch):
    (tmp_path / "runs").mkdir()
    for words in filter(is_run, LATER):
        line = " ".join(words)
        added = [o for beginning, o in SHORTER.items() if line.startswith(beginning)]
        with monkeypatch.context() as machine:
            if begins(line, UNCOMPILED):
                machine.setenv("CC", "no-compiler")
            done = klab(*words[1:], *(added[0] if added else ()), cwd=tmp_path)
        assert done.returncode == 0, f"{line}\n{done.stderr}"
        for at in (k + 1 for k, word in enumerate(words) if word == "--out"):
            made = tmp_path / words[at]
            assert made.exists() or list(made.parent.glob(f"{made.name}*")), line

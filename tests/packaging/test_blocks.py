"""The README's blocks behind the first hour, in order, each on what the blocks before it left.

A line of the README that is neither run here nor named in ELSEWHERE fails the test, so nobody can
add one that is not thought of.
"""

import contextlib
import shutil
import subprocess
from pathlib import Path

import pytest
from checkout import ROOT, checkout
from cluster import cluster
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
    "klab calibrate --robot dynamic --lockstep": (
        *("--segments", "20", *SHORT_RUNS, "--set", "sampler.largest_steps=30"),
    ),
    "klab calibrate --lockstep": ("--segments", "2", *SHORT_RUNS),
    "klab reference": ("--runs", "2"),
    "klab park --model": ("--set", "controller.horizon=25"),
    "klab park --robot dynamic --model runs/dynamic.npz --cost ce": (
        *("--set", "controller.time_limit_s=1"),
    ),
    "klab compare": ("--set", "controller.horizon=10", "--set", "controller.time_limit_s=1"),
    "klab simulate": ("--set", "controller.horizon=10", "--duration", "1"),
    "klab bench lockstep": ("--seconds", "2"),
    "klab study weights": ("--factors", "1", "--duration", "1"),
    "klab study dynamic-parking --model runs/dynamic.npz --dask": (*NEAR, "--runs", "1"),
    **{f"klab study {name}": (*ONE_RUN, *NEAR) for name in MANY},
    "klab study horizon": ONE_RUN,
    "klab dataset needed": ("--repetitions", "1"),
    "klab reproduce": ("--only", "simulation-parallel-lifted"),
}
"""What the test adds to a command that begins so: the same command, on less."""

NEED_NOT_PARK = ("klab park --robot dynamic --model runs/dynamic.npz --cost ce",)
"""That this cost leaves the robot beside the goal is what it is there to show."""
NOT_PARKED = 1

NO_BUS = (
    *("klab simulate", "klab study", "klab bench motor", "klab bench lockstep"),
    *("klab bench dataset", "./scripts/show-results"),
)
"""Commands that need no bus and no other process, beside those of ALONE."""

ELSEWHERE = {
    "waits for a lab, a bus or Ctrl-C; run by tests/packaging/test_readme_live.py": (
        *("klab up", "klab estop", "klab goal", "klab status", "klab down", "klab run"),
        *("klab view", "klab topics", "klab fault", "klab replay", "lcm-logplayer"),
        "klab calibrate --robot-name",
    ),
    "trained from the log of a replay, there too": ("klab train runs/replay",),
    "on less, with what it prints looked at: tests/bench/test_bench.py, test_fault_table.py": (
        *("klab bench faults", "klab bench realtime", "klab bench ocp", "klab bench parks"),
        *("klab bench logger", "klab bench edmd", "klab bench view"),
    ),
    "in a browser: tests/browser/test_bench_stop.py": ("klab bench stop",),
    "would run this test within itself": ("./scripts/test", "./scripts/check"),
    "needs Java and a screen: tests/packaging/test_spy.py": ("./scripts/spy",),
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


@pytest.fixture
def folder(tmp_path):
    checkout(tmp_path)
    shutil.copy(ROOT / "README.md", tmp_path)
    (tmp_path / "runs").mkdir()
    return tmp_path


def test_each_line_does_its_job_on_what_those_before_it_left(folder, monkeypatch):
    for words in filter(is_run, LATER):
        line = " ".join(words)
        added = next((o for beginning, o in SHORTER.items() if line.startswith(beginning)), ())
        with monkeypatch.context() as machine, contextlib.ExitStack() as stack:
            if begins(line, UNCOMPILED):
                machine.setenv("CC", "no-compiler")
            if "--dask" in words:
                _, address = stack.enter_context(cluster(folder, workers=1))
                added = (*added, "--dask", address)
            done = typed(words, added, folder)
        codes = (0, NOT_PARKED) if begins(line, NEED_NOT_PARK) else (0,)
        assert done.returncode in codes, f"{line}\n{done.stdout}{done.stderr}"
        for at in (k + 1 for k, word in enumerate(words) if word == "--out"):
            made = folder / words[at]
            assert made.exists() or list(made.parent.glob(f"{made.name}*")), line
    assert (folder / "runs" / "park" / "session-csv" / "R1_MPC_STATE.csv").exists()
    shown = (folder / "README.md").read_text()
    assert "44 not measured" in shown.partition("<!-- results -->")[2]


def typed(words: list[str], added: tuple[str, ...], cwd: Path):
    """Run a line to its end."""
    if words[0] == "klab":
        return klab(*words[1:], *added, cwd=cwd)
    return subprocess.run(words, cwd=cwd, capture_output=True, text=True, check=False)

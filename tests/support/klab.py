"""Runs the ``klab`` command as a person does, in processes of its own."""

import contextlib
import fcntl
import io
import json
import os
import signal
import subprocess
import sys
import termios
from collections.abc import Callable
from pathlib import Path

KLAB = [sys.executable, "-m", "offboard.cli.main"]
LIMIT_S = 150.0
REFERENCE = Path(__file__).parents[2] / "tests" / "data" / "reference"
OLDER = REFERENCE.parent / "older"
"""Logs of the first version, before any type of message changed."""
MODEL = REFERENCE / "model.npz"
"""Of the kinematic robot, from a whole session; made by scripts/reference."""

SMALL_AREA = [
    *("--set", "sampler.draw_set.x1_m=[0.4, 0.8]"),
    *("--set", "sampler.draw_set.x2_m=[-0.2, 0.2]"),
    *("--set", "sampler.largest_steps=30"),
]
"""Short drives, for sessions in real time."""

SHORT_RUNS = [
    *("--set", "sampler.draw_set.x1_m=[0.2, 0.4]"),
    *("--set", "sampler.draw_set.x2_m=[-0.1, 0.1]"),
    *("--set", "sampler.draw_set.theta_rad=[-0.8, 0.8]"),
    *("--set", "sampler.position_tolerance_m=0.6"),
    *("--set", "sampler.largest_steps=20"),
]
"""Hardly any way between the runs, for sessions in real time: 3 s a segment."""

NO_RADIO_LOSS = ("--set", "simulation.radio.from_robot.loss=0.0")
"""So that every message that is missing was lost on this machine."""


ALONE = (
    "config",
    "guide",
    "train",
    "dataset",
    "figure",
    "log",
    "model",
    "validate",
    "rerun",
    "reproduce",
)
"""Commands that start no process and hear no bus; like all in lockstep, they can run here."""


def klab(*arguments: str | Path, **kwargs) -> subprocess.CompletedProcess[str]:
    """Run to the end and return what it said.

    What needs no process of its own runs in this one: starting one takes longer than most of what
    is asked of it.
    """
    command = [*KLAB, *map(str, arguments)]
    alone = command[3] in ALONE or {"--lockstep", "--help"} & set(command)
    if alone and not kwargs.keys() - {"cwd"}:
        return klab_here(*arguments, **kwargs)
    return subprocess.run(
        command, capture_output=True, text=True, check=False, timeout=LIMIT_S, **kwargs
    )


def klab_here(*arguments: str | Path, cwd: Path | None = None) -> subprocess.CompletedProcess[str]:
    """Run in this process to the end, and return what it said."""
    from offboard.cli.main import main

    said, told, before, folder = io.StringIO(), io.StringIO(), sys.argv, Path.cwd()
    sys.argv = command = ["klab", *map(str, arguments)]
    os.chdir(cwd or folder)
    try:
        with contextlib.redirect_stdout(said), contextlib.redirect_stderr(told):
            main()
        code = 0
    except SystemExit as end:
        code = end.code or 0
    finally:
        sys.argv = before
        os.chdir(folder)
    return subprocess.CompletedProcess(command, code, said.getvalue(), told.getvalue())


def klab_ok(*arguments: str | Path) -> str:
    """Run to the end, expect success, return standard output."""
    done = klab(*arguments)
    assert done.returncode == 0, done.stderr
    return done.stdout


def klab_json(*arguments: str | Path):
    """Run with ``--json`` and return what it printed."""
    return json.loads(klab_ok(*arguments, "--json"))


def start_klab(*arguments: str | Path, cwd: Path | None = None) -> subprocess.Popen[str]:
    """Start in the background, with signals as a terminal leaves them."""
    return subprocess.Popen(
        [*KLAB, *map(str, arguments)],
        cwd=cwd,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )


def alive(pid: int) -> bool:
    """Return whether a process exists and is no zombie."""
    try:
        state = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]
    except FileNotFoundError:
        return False
    return state != "Z"


def environment(**changes: str) -> dict[str, str]:
    """Return this process's environment with changes."""
    return os.environ | changes


def controlled_by(terminal: int) -> Callable[[], None]:
    """Return what a new session does before its program: take this terminal, heed Ctrl-C."""

    def take() -> None:
        fcntl.ioctl(terminal, termios.TIOCSCTTY, 0)
        signal.signal(signal.SIGINT, signal.default_int_handler)

    return take

"""The lines of the guides, each run once in a test run, on what the lines before it have left.

A line says itself what it needs: the files it names that stand behind `--out` in an earlier one.
So no list of chains has to follow the guides, and lines that share a session run side by side, in
as many processes as there are, while it is recorded by whichever asks first.
"""

import contextlib
import fcntl
import json
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from checkout import checkout
from cluster import cluster
from guide_pages.pages import BY_HAND, LINES, PAGES, ROOT
from klab import ALONE, SHORT_RUNS, klab

ONE_RUN = ("--runs", "1", "--workers", "1")
SHORT_HORIZON = ("--set", "controller.horizon=5")
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
    "klab calibrate --lockstep --set": ("--segments", "2", *SHORT_RUNS),
    "klab reference": ("--runs", "2"),
    "klab park --model runs/model.npz": ("--set", "controller.horizon=25"),
    "klab park --robot dynamic --model runs/dynamic.npz --cost ce": (
        *("--set", "controller.time_limit_s=1"),
    ),
    "klab compare": ("--set", "controller.horizon=10", "--set", "controller.time_limit_s=1"),
    "klab simulate": ("--set", "controller.horizon=10", "--duration", "1"),
    "klab bench lockstep": ("--seconds", "2"),
    "klab bench authentication": ("--messages", "1000"),
    "klab bench dataset": ("--repetitions", "1"),
    "klab dataset sweep": ("--windows", "10,40"),
    "klab study weights": ("--factors", "1", "--duration", "1"),
    "klab study dynamic-parking --model runs/dynamic.npz --dask": (*SHORT_HORIZON, "--runs", "1"),
    **{f"klab study {name}": (*ONE_RUN, *SHORT_HORIZON) for name in MANY},
    "klab study horizon": ONE_RUN,
    "klab dataset needed": ("--repetitions", "1"),
    "klab reproduce": ("--only", "simulation-parallel-lifted"),
}
"""What is added to a command that begins so: the same command, on less."""

NEED_NOT_PARK = ("klab park --robot dynamic --model runs/dynamic.npz --cost ce",)
"""That this cost leaves the robot beside the goal is what it is there to show."""
NOT_PARKED = 1

NO_BUS = (
    *("klab simulate", "klab study", "klab bench motor", "klab bench lockstep"),
    *(
        "klab bench dataset",
        "klab bench authentication",
        "./scripts/show-results",
        "./scripts/show-messages",
        "./scripts/demo --lockstep",
    ),
)
"""Commands that need no bus and no other process, beside those of ALONE."""

IN_PYTHON = re.compile(r"[\"'](runs/[^\"']+)")
"""A path in a block of Python."""
SAVED_BY_PYTHON = re.compile(r"\.save\([\"'](runs/[^\"']+)")


def begins(line: str, with_any) -> bool:
    return any(line.startswith(beginning) for beginning in with_any)


def is_alone(words: list[str]) -> bool:
    """Return whether a line needs no bus and no process beside it."""
    if words[0] == "python":
        return True
    alone = words[0] == "klab" and (words[1] in ALONE or "--lockstep" in words)
    return alone or begins(" ".join(words), NO_BUS)


def leaves(words: list[str]) -> list[str]:
    """Return the paths that a line leaves something at."""
    if words[0] == "python":
        return SAVED_BY_PYTHON.findall(words[2])
    return [words[k + 1] for k, word in enumerate(words) if word == "--out"]


def reads(words: list[str]) -> list[str]:
    """Return the paths at which a line expects something."""
    if words[0] == "python":
        return [path for path in IN_PYTHON.findall(words[2]) if path not in leaves(words)]
    named = [word for word in words if word.startswith("runs/") and word not in BY_HAND]
    return [path for path in named if path not in leaves(words) or "--resume" in words]


def once(folder: Path, name: str, do: Callable[[], object]):
    """Do something once in a test run, in the process that asks first; the others wait for it.

    Returns
    -------
        What ``do`` returned, by way of JSON.
    """
    record = folder / f"{name}.json"
    with (folder / f"{name}.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not record.exists():
            record.write_text(json.dumps(do()))
        return json.loads(record.read_text())


class TypedGuides:
    """What a person has who types the guides, up to any line of them.

    Parameters
    ----------
    folder
        Shared by all processes of a test run.
    """

    def __init__(self, folder: Path) -> None:
        self._records = folder / "records"
        self._records.mkdir(parents=True, exist_ok=True)
        self.checkout = folder / "checkout"
        once(self._records, "checkout", self._prepare)
        self._url = once(self._records, "bus", lambda: os.environ["LCM_DEFAULT_URL"])

    def line(self, number: int) -> str:
        """See that a line has run, after those that it needs; return what it said.

        Raises
        ------
        AssertionError
            If it, or one that it needs, did not do its job.
        """
        line = " ".join(LINES[number])
        # Whoever waits holds later lines only, so nobody waits in a circle.
        code, told = once(self._records, str(number), lambda: self._run(number))
        allowed = (0, NOT_PARKED) if begins(line, NEED_NOT_PARK) else (0,)
        assert code in allowed, f"{line}\n{told}"
        for path in leaves(LINES[number]):
            left = self.checkout / path
            assert left.exists() or list(left.parent.glob(f"{left.name}*")), line
        return told

    def told(self, words: list[str]) -> str:
        """See that the line of these words has run; return what it said."""
        return self.line(LINES.index(words))

    def with_left(self, *paths: str) -> Path:
        """See that the lines have run that leave these paths; return the folder of the checkout."""
        for path in paths:
            number = _who_leaves(path, len(LINES))
            assert number is not None, f"no line of the guides leaves {path}"
            self.line(number)
        return self.checkout

    def with_typed(self, *lines: str) -> Path:
        """See that these lines have run; return the folder of the checkout."""
        numbers = {" ".join(words): number for number, words in enumerate(LINES)}
        for line in lines:
            assert line in numbers, f"no guide has the line `{line}` any more"
            self.line(numbers[line])
        return self.checkout

    def _prepare(self) -> None:
        programs = checkout(self.checkout)
        (programs / "activate").write_text(f"PATH={programs}:$PATH\n")
        for page in PAGES:
            (self.checkout / page).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(ROOT / page, self.checkout / page)
        (self.checkout / "runs").mkdir()
        for name, text in BY_HAND.items():
            (self.checkout / name).write_text(text)

    def _run(self, number: int) -> tuple[int, str]:
        """Run a line to its end; return its exit code and what it said."""
        words = LINES[number]
        line = " ".join(words)
        for path in reads(words):
            before = _who_leaves(path, number)
            # Where a block of Python writes is known to itself alone.
            assert before is not None or words[0] == "python", f"{line}: nothing leaves {path}"
            if before is not None:
                self.line(before)
        added = next((o for beginning, o in SHORTER.items() if line.startswith(beginning)), ())
        with pytest.MonkeyPatch.context() as machine, contextlib.ExitStack() as stack:
            # Of all processes the same: it is among the settings that --resume compares.
            machine.setenv("LCM_DEFAULT_URL", self._url)
            if begins(line, UNCOMPILED):
                machine.setenv("CC", "no-compiler")
            if "--dask" in words:
                _, address = stack.enter_context(cluster(self.checkout, workers=1))
                added = (*added, "--dask", address)
            if words[0] == "klab":
                done = klab(*words[1:], *added, cwd=self.checkout)
            else:
                words = [sys.executable, *words[1:]] if words[0] == "python" else words
                done = subprocess.run(
                    [*words, *added], cwd=self.checkout, capture_output=True, text=True, check=False
                )
        return done.returncode, f"{done.stdout}{done.stderr}"


def _who_leaves(path: str, before: int) -> int | None:
    """Return the last line before one that leaves a path, or something in a folder above it."""
    for number in reversed(range(before)):
        for left in leaves(LINES[number]):
            if Path(path).is_relative_to(left):
                return number
    return None

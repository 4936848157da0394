"""Runs steps, each a `klab` command with a folder of its own, and remembers which are done."""

from __future__ import annotations

import contextlib
import fcntl
import logging
import os
import shlex
import shutil
import subprocess
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path

from koopman_lab.errors import DataError, LabStateError, UsageError
from koopman_lab.files import sha256, write_json
from koopman_lab.json_file import JsonTable, Refusal, read_table
from offboard.lab.python_process import module_command
from offboard.lab.run_folder import revision
from offboard.reproduction.paper.step_record import StepRecord

MARKER = "done.json"
"""In the folder of a step that succeeded."""
RUN_AGAIN = "the step is run again"
LOGS = "logs"
LOCK = ".lock"
LOCK_LIMIT_S = 10.0
"""Within which the steps of a run that was killed notice it and end."""
LOCK_PERIOD_S = 0.1
LONGEST_LINE = 300


class _Marker(JsonTable):
    """What a step's marker says; those of older versions have no hashes."""

    arguments: list[str]
    seconds: float
    version: str
    sha256: dict[str, str] | None = None


@dataclass(frozen=True)
class Step:
    """One command.

    Attributes
    ----------
    name
        Of its folder.
    arguments
        Of `klab`, with paths relative to the folder that holds the steps' folders. Words that begin
        with the name of another step, alone or before a slash, are what it needs.
    resumable
        Whether the command goes on with what it left unfinished when told ``--resume``.
    parallel
        Whether it uses all workers itself.
    """

    name: str
    arguments: tuple[str, ...]
    resumable: bool = False
    parallel: bool = False

    @property
    def command(self) -> str:
        """Return the line that a person types in the folder that holds the steps' folders."""
        return shlex.join(["klab", *self.arguments])

    def needs(self, steps: Sequence[Step]) -> set[str]:
        """Return the names of the steps whose files this one reads."""
        heads = {argument.split("/")[0] for argument in self.arguments}
        return {step.name for step in steps if step.name in heads} - {self.name}


def with_needs(steps: Sequence[Step], names: Sequence[str]) -> list[Step]:
    """Return the steps of these names and all that they need, in order.

    Parameters
    ----------
    steps
        In order, each behind those it needs.
    names
        Of some of them.

    Raises
    ------
    UsageError
        If no step has such a name.
    """
    selected = set(names)
    unknown = selected - {step.name for step in steps}
    if unknown:
        raise UsageError(
            f"{', '.join(sorted(unknown))}: no such step; there are "
            f"{', '.join(step.name for step in steps)}"
        )
    for step in reversed(steps):
        if step.name in selected:
            selected |= step.needs(steps)
    return [step for step in steps if step.name in selected]


def finished(folder: Path, steps: Sequence[Step]) -> dict[str, StepRecord]:
    """Return the steps that need not run again, by name.

    One is done when it succeeded with these very arguments, what it brought is as it left it, and
    nothing it needs runs again.
    """
    done: dict[str, StepRecord] = {}
    for step in steps:
        file = folder / step.name / MARKER
        if not file.exists():
            continue
        try:
            marker = read_table(Refusal(file, "the note of a step", RUN_AGAIN, DataError), _Marker)
            if marker.sha256 is not None and _hashes(file.parent, marker.sha256) != marker.sha256:
                raise DataError(f"{file.parent}: not as the step left it; {RUN_AGAIN}")
        except (DataError, OSError) as error:
            logging.getLogger(__name__).warning("%s", error)
            continue
        if marker.arguments == list(step.arguments) and step.needs(steps) <= done.keys():
            done[step.name] = StepRecord(step.command, marker.seconds, marker.version)
    return done


def _hashes(folder: Path, names: Iterable[str]) -> dict[str, str | None]:
    """Return the SHA-256 of files of a folder by their names; None for what is no file in it."""
    files = {str(file.relative_to(folder)): file for file in folder.rglob("*") if file.is_file()}
    return {name: sha256(files[name]) if name in files else None for name in names}


def run(
    folder: Path, steps: Sequence[Step], workers: int, tell: Callable[[str], None]
) -> dict[str, StepRecord]:
    """Run what is not done yet, up to ``workers`` steps at a time, and return all by name.

    Steps stand behind those they need. One that fails keeps others from beginning; those that run
    already come to their end.

    Parameters
    ----------
    folder
        Holds the steps' folders.
    steps
        In order.
    workers
        How many processes may work at once.
    tell
        Takes a line for each step that begins or ends.

    Raises
    ------
    LabStateError
        If a step fails, or another process works in the folder.
    """
    with _folder_lock(folder) as lock, _lifeline() as (lifeline, cut):
        done = finished(folder, steps)
        done_before = set(done)
        waiting = [step for step in steps if step.name not in done]
        if done:
            tell(f"{len(done)} of {len(steps)} steps are done already")
        running: dict[Future[StepRecord], Step] = {}
        with ThreadPoolExecutor(max_workers=workers) as pool, _cut_on_interrupt(cut):
            while waiting or running:
                for step in list(waiting):
                    if not step.needs(steps) <= done.keys() or not _has_room(
                        step, running, workers
                    ):
                        continue
                    waiting.remove(step)
                    tell(f"{step.name}: {step.command}")
                    # What was begun with files that have been made anew since begins anew.
                    from_scratch = not step.resumable or not step.needs(steps) <= done_before
                    run_arguments = (folder, step, workers, from_scratch, (lock, lifeline))
                    running[pool.submit(_run_step, *run_arguments)] = step
                for future in wait(running, return_when=FIRST_COMPLETED).done:
                    step = running.pop(future)
                    done[step.name] = record = future.result()
                    tell(f"{step.name}: {record.seconds:.0f} s; {len(done)} of {len(steps)} done")
    return {step.name: done[step.name] for step in steps}


def _has_room(step: Step, running: dict[Future[StepRecord], Step], workers: int) -> bool:
    if step.parallel or any(other.parallel for other in running.values()):
        return not running
    return len(running) < workers


def _run_step(
    folder: Path, step: Step, workers: int, from_scratch: bool, descriptors: tuple[int, int]
) -> StepRecord:
    """Run a step's command; ``descriptors`` are those of lock and lifeline."""
    step_folder = folder / step.name
    marker = step_folder / MARKER
    arguments = list(step.arguments)
    if step.parallel:
        # Not among the step's own arguments: the numbers do not hang on it.
        arguments += ["--workers", str(workers)]
    if step_folder.exists():
        marker.unlink(missing_ok=True)
        if from_scratch:
            shutil.rmtree(step_folder)
        else:
            arguments.append("--resume")
    log = folder / LOGS / f"{step.name}.txt"
    log.parent.mkdir(exist_ok=True)
    began_s = time.monotonic()
    with log.open("wb") as file:
        code = subprocess.run(
            module_command("offboard.cli.end_with_parent", str(descriptors[1]), *arguments),
            cwd=folder,
            stdin=subprocess.DEVNULL,
            stdout=file,
            stderr=file,
            # The lock is held until the last step has ended, too, should this process be killed.
            pass_fds=descriptors,
            check=False,
        ).returncode
    if code != 0:
        raise LabStateError(
            f"step {step.name} failed (exit code {code}): {_last_line(log)}\n"
            f"All it said is in {log}; then go on with --resume"
        )
    seconds = time.monotonic() - began_s
    made_by = f"{version('koopman-lab')}, {revision() or 'no revision'}"
    files = [str(f.relative_to(step_folder)) for f in step_folder.rglob("*") if f.is_file()]
    facts = {
        "arguments": list(step.arguments),
        "seconds": seconds,
        "version": made_by,
        "sha256": _hashes(step_folder, sorted(files)),
    }
    write_json(marker, facts)
    return StepRecord(step.command, seconds, made_by)


def _last_line(log: Path) -> str:
    lines = log.read_text(errors="replace").strip().splitlines()
    return lines[-1][-LONGEST_LINE:] if lines else "it said nothing"


@contextlib.contextmanager
def _folder_lock(folder: Path) -> Iterator[int]:
    """Keep others out of the folder; gives the descriptor of the lock."""
    with (folder / LOCK).open("w") as file:
        end_s = time.monotonic() + LOCK_LIMIT_S
        while True:
            try:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
                break
            except BlockingIOError:
                if time.monotonic() > end_s:
                    raise LabStateError(
                        f"{folder}: another `klab reproduce` works in it; wait for it, or choose "
                        "another folder with --out"
                    ) from None
                time.sleep(LOCK_PERIOD_S)
        yield file.fileno()


@contextlib.contextmanager
def _lifeline() -> Iterator[tuple[int, Callable[[], None]]]:
    """Give the read end of a pipe whose write end is gone when this process is, or when cut."""
    read, write = os.pipe()
    with open(write, "wb") as end:  # noqa: PTH123 - a descriptor is no path
        try:
            yield read, end.close
        finally:
            os.close(read)


@contextlib.contextmanager
def _cut_on_interrupt(cut: Callable[[], None]) -> Iterator[None]:
    """End the running steps at Ctrl-C, which may have reached this process alone."""
    try:
        yield
    except KeyboardInterrupt:
        cut()
        raise

"""What lies in the folder of runs: how each run ended, and what a person may go on with."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from koopman_lab.errors import LabError, LabStateError
from koopman_lab.eventlog.log_name import LOG_NAME, SUMMARY_NAME
from koopman_lab.json_file import JsonTable, Refusal, read_table
from koopman_lab.koopman.model_file import read_model_file
from offboard.lab.run_folder import RunFolder
from offboard.lab.run_outcome import outcome_of
from offboard.monitor.state_in_words import IDLE, WARN, StateInWords

DEPTH = 3
"""So many folders below that of the runs are looked at: a demo holds a calibration and a park."""
MOST_RUNS = 100
"""The newest; a person looks for older ones on the disk."""
LARGEST_MODEL_BYTES = 1 << 22
"""Assumption: the paper's models have 10 kB. A larger .npz is a data set."""
COMMANDING = {"sampler": "calibrate", "controller": "park", "reference": "reference"}
"""Which command starts a node that drives."""
USED = ("model", "cost", "seed")
"""Keys of a summary that say what a run used."""
PASSED_OVER = ("processes",)
"""Folders in a run folder that hold no runs."""


class PastRun(NamedTuple):
    """A run folder.

    Attributes
    ----------
    folder
        Where it is.
    what
        Which command made it; empty if nobody knows.
    at_s
        When its summary was written, or else when it began (s since 1970).
    robot
        Kind of its robot; empty if nobody knows.
    outcome
        How it ended.
    uses
        What it used, by the name: model, cost, seed, as far as the summary says.
    log
        Whether a session was recorded.
    """

    folder: Path
    what: str
    at_s: float
    robot: str
    outcome: StateInWords
    uses: dict[str, str]
    log: bool


class PastModel(NamedTuple):
    """A model file.

    Attributes
    ----------
    file
        Where it is.
    written_s
        When it was written (s since 1970).
    robot
        Kind of its robot.
    name
        Of its dictionary, or else of its predictor.
    verdict
        good, weak, unusable as it was judged in training; empty if it was not.
    """

    file: Path
    written_s: float
    robot: str
    name: str
    verdict: str


class RunHistory:
    """Looks at a folder of runs again and again; what has not changed is not read again.

    Parameters
    ----------
    root
        The folder; it need not exist.
    """

    def __init__(self, root: Path) -> None:
        self.root = root
        self._seen: dict[Path, tuple[tuple[int, int], Any]] = {}

    def look(self) -> tuple[list[PastRun], list[PastModel]]:
        """Return runs and models, the newest first."""
        seen, self._seen = self._seen, {}
        runs: list[PastRun] = []
        models: list[PastModel] = []
        for folder, names in _folders(self.root):
            for name in names:
                file = folder / name
                if name == SUMMARY_NAME or (name == LOG_NAME and SUMMARY_NAME not in names):
                    run = self._read(seen, file, _run)
                    if run is not None:
                        runs.append(run._replace(log=LOG_NAME in names))
                elif name.endswith(".npz"):
                    model = self._read(seen, file, past_model)
                    if model is not None:
                        models.append(model)
        runs.sort(key=lambda run: run.at_s, reverse=True)
        models.sort(key=lambda model: model.written_s, reverse=True)
        return runs[:MOST_RUNS], models

    def _read(self, seen: Mapping[Path, Any], file: Path, read: Any) -> Any:
        """Return what a file says, None if nothing can be made of it."""
        try:
            facts = file.stat()
        except OSError:
            return None
        state = facts.st_mtime_ns, facts.st_size
        known = seen.get(file)
        value = known[1] if known is not None and known[0] == state else read(file, facts)
        self._seen[file] = state, value
        return value


def _folders(root: Path) -> Iterator[tuple[Path, list[str]]]:
    """Give the folders in which runs may be, with the names of their files."""
    for path, folders, names in os.walk(root):
        folder = Path(path)
        if len(folder.relative_to(root).parts) == DEPTH:
            folders.clear()
        folders[:] = [f for f in folders if f not in PASSED_OVER and not f.startswith(".")]
        yield folder, names


def _run(file: Path, facts: os.stat_result) -> PastRun:
    """Return what a summary says, or a log without one."""
    folder, ended_s = file.parent, facts.st_mtime
    if file.name != SUMMARY_NAME:
        what, outcome = _without_summary(folder)
        return PastRun(folder, what, _begun_s(folder, ended_s), "", outcome, {}, log=True)
    refusal = Refusal(file, "a summary", "the log beside it is whole", LabStateError)
    try:
        summary = read_table(refusal, JsonTable).model_dump()
    except LabError as error:
        damaged = StateInWords("summary damaged", WARN, str(error))
        return PastRun(folder, "", ended_s, "", damaged, {}, log=False)
    uses: dict[str, str] = {key: str(summary[key]) for key in USED if key in summary}
    what, robot = str(summary.get("what", "")), str(summary.get("robot", ""))
    return PastRun(folder, what, ended_s, robot, outcome_of(summary), uses, log=False)


def _without_summary(folder: Path) -> tuple[str, StateInWords]:
    """Return what a log without a summary is of, by the processes that the command started."""
    for node, what in COMMANDING.items():
        if RunFolder(folder).process_log(node).exists():
            return what, StateInWords("not finished", WARN, "no summary was written")
    return "log", StateInWords("recorded", IDLE)


def _begun_s(folder: Path, otherwise_s: float) -> float:
    """Return when a run began (s since 1970): a log that goes on growing is no newer for it."""
    try:
        return RunFolder(folder).config.stat().st_mtime
    except OSError:
        return otherwise_s


def past_model(file: Path, facts: os.stat_result) -> PastModel | None:
    """Return what a model file says; None for a file that is none, or of another version."""
    if facts.st_size > LARGEST_MODEL_BYTES:
        return None
    try:
        header = read_model_file(file).header
    except LabError:
        return None
    verdict = header["metadata"].get("verdict") or {}
    judged = verdict.get("model") if isinstance(verdict, dict) else None
    level = str(judged.get("level", "")) if isinstance(judged, dict) else ""
    name = str(header.get("dictionary") or header["predictor"])
    return PastModel(file, facts.st_mtime, header["robot"], name, level)

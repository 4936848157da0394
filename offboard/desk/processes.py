"""The one table of processes: what each needs, who may stop it, and in which order they stop."""

from __future__ import annotations

from typing import NamedTuple

import lcmtypes


class Process(NamedTuple):
    """One row.

    Attributes
    ----------
    name
        The node, as in ``klab run NAME``.
    needs
        Nodes without which it has nothing to do.
    stopped_by
        Who may stop it, in words; whatever else ends it is a crash.
    """

    name: str
    needs: tuple[str, ...]
    stopped_by: str


_COMMAND = "the command that started it"
STARTER = f"{_COMMAND}, by Ctrl-C or `klab down`"
PROCESSES: tuple[Process, ...] = (
    Process("sampler", ("onboard", "logger"), "itself when done, or `klab calibrate`"),
    Process("controller", ("onboard", "logger"), "itself when done, or `klab park`"),
    Process("reference", ("onboard", "logger"), "itself when done, or `klab reference`"),
    Process("slalom", ("onboard",), "`klab bench stop`"),
    Process("onboard", ("plant",), STARTER),
    Process("plant", (), STARTER),
    Process("logger", (), STARTER),
    Process("view", (), STARTER),
    Process("pacer", (), "`klab bench realtime`"),
)
"""In the order in which they stop: who commands first; the logger writes down the rest."""
COMMANDING = frozenset(process.name for process in PROCESSES if "onboard" in process.needs)
NAMES = tuple(process.name for process in PROCESSES)


def died(message: lcmtypes.process_t) -> str:
    """Return in words which process died, and how."""
    return f"{message.name} died ({message.ended})"


def who_stops(process: Process, told: lcmtypes.process_t | None) -> str:
    """Return in words who may stop a process; a command that speaks of it, by its number."""
    if told is None:
        return process.stopped_by
    return process.stopped_by.replace(_COMMAND, f"process {told.supervisor_pid}")

"""What the exit code of a command says: each code has one meaning, for all commands."""

from __future__ import annotations

from enum import IntEnum

from koopman_lab.errors import (
    BusError,
    DiskError,
    LabError,
    LabStateError,
    NotWrittenError,
    UsageError,
)


class ExitCode(IntEnum):
    """Exit codes of ``klab``; :data:`MEANINGS` says them in words."""

    DONE = 0
    NO = 1
    MISUSE = 2
    LAB_FAILURE = 3
    CRASH = 70
    INTERRUPTED = 130
    UNREAD = 141


MEANINGS = {
    ExitCode.DONE: "done, and what was asked for is so",
    ExitCode.NO: "ran to its end, and the answer is no: not parked, not complete, not as it was",
    ExitCode.MISUSE: "refused: what was typed, or a file that was named, cannot be used",
    ExitCode.LAB_FAILURE: "the lab failed: bus, robot, process or disk are not as they must be",
    ExitCode.CRASH: "a fault of this program; its traceback is printed, please report it",
    ExitCode.INTERRUPTED: "interrupted by Ctrl-C or `klab down`; what was recorded is kept",
    ExitCode.UNREAD: "whoever read the output has gone, as `head` does",
}
LAB_FAILURES = (BusError, LabStateError, DiskError, NotWrittenError)
"""Errors that another attempt may not meet, with the same words typed."""


def code_of(error: LabError) -> ExitCode:
    """Return the exit code of a command that ends with an expected mistake."""
    failed = isinstance(error, LAB_FAILURES) and not isinstance(error, UsageError)
    return ExitCode.LAB_FAILURE if failed else ExitCode.MISUSE

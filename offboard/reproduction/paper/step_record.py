"""The record of a finished step: its command, duration and version."""

from __future__ import annotations

from typing import NamedTuple


class StepRecord(NamedTuple):
    """A finished step: its command line, the seconds it took, the version that made it."""

    command: str
    seconds: float
    version: str

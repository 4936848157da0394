"""Why the robot must not be driven, and whether that passes by itself."""

from __future__ import annotations

from enum import Enum
from typing import NamedTuple


class Cause(Enum):
    """What an interlock is about."""

    TRACKING = "the cameras do not tell where the robot is"
    SILENCE = "a process that is needed is silent"
    HELD = "the robot is held still, or by another commander"
    STREAM = "a stream is not what a session needs"
    MOTION = "cameras, wheels and commands contradict each other"
    FLOOR = "the robot is not, or would not stay, on the floor"
    COMMANDER = "the program that drives cannot go on"
    RECORD = "nothing is written down any more"
    OTHER = "something else"


TO_BE_MENDED = (Cause.MOTION, Cause.FLOOR, Cause.COMMANDER, Cause.RECORD)
"""What ends a session while the robot is driven: nothing that passes, and no other's hold."""


class Interlock(NamedTuple):
    """Something without which the robot must not be driven is missing.

    Attributes
    ----------
    reason
        In words.
    lasting
        Whether a person has to act. Everything else, silence above all, may pass by itself.
    cause
        What it is about.
    """

    reason: str
    lasting: bool = False
    cause: Cause = Cause.OTHER

    @property
    def ends_session(self) -> bool:
        """Return whether a session is over also while the robot stands and waits."""
        return self.cause is Cause.COMMANDER

"""Why draws are given up, how often, and when that is once too often."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from enum import IntEnum

import lcmtypes
from offboard.desk.interlock import Cause, Interlock

_NUMBERS = lcmtypes.sampler_state_t


class Redraw(IntEnum):
    """Why a draw was given up; the numbers are those of ``sampler_state_t``."""

    DRAW_LEAVES_Z = _NUMBERS.DRAW_LEAVES_Z
    TRACKING_LOST = _NUMBERS.TRACKING_LOST
    SILENCE = _NUMBERS.SILENCE
    TOOK_TOO_LONG = _NUMBERS.TOOK_TOO_LONG
    COMMANDS_LATE = _NUMBERS.COMMANDS_LATE
    LEFT_Z_ON_THE_WAY = _NUMBERS.LEFT_Z_ON_THE_WAY
    LEFT_Z_IN_LAUNCH = _NUMBERS.LEFT_Z_IN_LAUNCH
    MISSED_POSE = _NUMBERS.MISSED_POSE
    RUN_WOULD_LEAVE_Z = _NUMBERS.RUN_WOULD_LEAVE_Z
    LEFT_Z_TOO_SOON = _NUMBERS.LEFT_Z_TOO_SOON
    CAMERA_STREAM = _NUMBERS.CAMERA_STREAM
    MUST_BE_MENDED = _NUMBERS.MUST_BE_MENDED
    BEFORE_INTERRUPTION = _NUMBERS.BEFORE_INTERRUPTION


TEXTS = {
    Redraw.DRAW_LEAVES_Z: "drawn state leaves Z too soon",
    Redraw.TRACKING_LOST: "tracking lost",
    Redraw.SILENCE: "onboard loop or logger silent",
    Redraw.TOOK_TOO_LONG: "phase took too long",
    Redraw.COMMANDS_LATE: "commands came too late",
    Redraw.LEFT_Z_ON_THE_WAY: "left Z on the way",
    Redraw.LEFT_Z_IN_LAUNCH: "left Z during the launch",
    Redraw.MISSED_POSE: "missed the drawn pose",
    Redraw.RUN_WOULD_LEAVE_Z: "run would leave Z too soon",
    Redraw.LEFT_Z_TOO_SOON: "left Z too soon",
    Redraw.CAMERA_STREAM: "camera frames missing, doubled or not numbered",
    Redraw.MUST_BE_MENDED: "stopped by what a person has to mend",
    Redraw.BEFORE_INTERRUPTION: "before the interruption",
}
_SETS = (
    "enlarge sampler.admissible_set, or lower sampler.smallest_steps; a robot that does not go "
    "where it is sent has wrong axes, wheels or geometry"
)
_HINTS = {
    Redraw.TRACKING_LOST: "see whether the cameras see the robot everywhere in the draw set",
    Redraw.SILENCE: "see whether the radio reaches the robot, and the logger can write",
    Redraw.TOOK_TOO_LONG: "see whether the robot turns and drives as commanded, or raise "
    "sampler.phase_time_limit_s",
    Redraw.COMMANDS_LATE: "end what else this machine does, or use a faster one",
    Redraw.LEFT_Z_ON_THE_WAY: _SETS,
    Redraw.LEFT_Z_IN_LAUNCH: _SETS,
    Redraw.MISSED_POSE: "see whether the robot goes where it is sent, or loosen "
    "sampler.position_tolerance_m and sampler.angle_tolerance_rad",
    Redraw.RUN_WOULD_LEAVE_Z: _SETS,
    Redraw.LEFT_Z_TOO_SOON: _SETS,
    Redraw.CAMERA_STREAM: "see `klab topics` for the rate of the cameras",
    Redraw.MUST_BE_MENDED: "see `klab status` for what holds the robot",
}
_OF_CAUSE = {
    Cause.TRACKING: Redraw.TRACKING_LOST,
    Cause.SILENCE: Redraw.SILENCE,
    Cause.STREAM: Redraw.CAMERA_STREAM,
}


def redraw_of(interlock: Interlock) -> Redraw:
    """Return as what a draw is given up because of an interlock."""
    return _OF_CAUSE.get(interlock.cause, Redraw.MUST_BE_MENDED)


class Redraws:
    """Counts draws that were given up, in all by reason and in a row.

    Parameters
    ----------
    largest_in_a_row
        After so many without a complete segment between them it is enough.
    before
        Number of those of an interrupted session that goes on.
    """

    def __init__(self, largest_in_a_row: int, before: int = 0) -> None:
        self._largest_in_a_row = largest_in_a_row
        self._counts: Counter[Redraw] = Counter()
        self._in_a_row: Counter[Redraw] = Counter()
        if before:
            self._counts[Redraw.BEFORE_INTERRUPTION] = before

    def add(self, reason: Redraw) -> None:
        """Count one that was driven for in vain."""
        self._counts[reason] += 1
        self._in_a_row[reason] += 1

    def add_draw(self) -> None:
        """Count a draw that was given up before anything moved for it."""
        self._counts[Redraw.DRAW_LEAVES_Z] += 1

    def succeed(self) -> None:
        """Note a complete segment."""
        self._in_a_row.clear()

    @property
    def too_many(self) -> str:
        """Return why there are too many in a row and what to do; empty as long as there are not."""
        number = self._in_a_row.total()
        if number < self._largest_in_a_row:
            return ""
        reason, count = self._in_a_row.most_common(1)[0]
        return (
            f"{number} draws in a row were given up (sampler.largest_redraws_in_a_row), {count} of "
            f"them because: {TEXTS[reason]}; {_HINTS[reason]}"
        )

    def total(self) -> int:
        """Return how many there were in all."""
        return self._counts.total()

    def numbers(self) -> list[int]:
        """Return how many there were by the number of the reason."""
        return [self._counts[Redraw(i)] if i in _KNOWN else 0 for i in range(_NUMBERS.REASONS)]

    def by_text(self) -> dict[str, int]:
        """Return how many there were by the reason in words, in alphabetical order."""
        return dict(sorted((TEXTS[reason], n) for reason, n in self._counts.items()))


_KNOWN = frozenset(int(reason) for reason in Redraw)


def redraws_text(numbers: Sequence[int]) -> str:
    """Return in a few words what ``sampler_state_t.redraws_by_reason`` says; empty if nothing."""
    reasons = [(TEXTS[Redraw(i)], n) for i, n in enumerate(numbers) if n and i in _KNOWN]
    if not reasons:
        return ""
    return "drawn again: " + ", ".join(f"{text} {n}" for text, n in reasons)

"""Whether who is heard speaks now, or is a log that is sent again."""

from __future__ import annotations

from typing import Any

from koopman_lab.bus.channel import ABOARD, OPERATOR, Channel
from koopman_lab.bus.replay_guard import from_log
from koopman_lab.units import US_PER_S

REPLAY_MEMORY_S = 3.0
"""So long after its last message a replay still counts as going on."""
BACKLOG_S = 0.5
"""So long old messages keep coming before they count as a replay. What waited for a process that
stood still is read in less than 0.1 s, all of it."""


class ReplayDetection:
    """Judges for one robot by the times of its messages."""

    def __init__(self) -> None:
        self.spoken_us = 0
        """When somebody spoke last who is no person (us)."""
        self._fresh_us: int | None = None
        self._old_us: int | None = None
        self._old_since_us = 0
        self._replay_us: int | None = None

    def judge(self, channel: Channel[Any], utime: int, arrived_us: int) -> None:
        """Tell what is said now from what a log said once; the board's clock may be wrong.

        What a person says to a robot, here or elsewhere, is no sign of the robot.
        """
        if channel.publisher == OPERATOR:
            return
        self.spoken_us = arrived_us
        if not from_log(utime, arrived_us):
            self._fresh_us = arrived_us
        elif channel.publisher != ABOARD:
            if not _lately(self._old_us, arrived_us):
                self._old_since_us = arrived_us
            self._old_us = arrived_us
            if arrived_us - self._old_since_us >= BACKLOG_S * US_PER_S:
                self._replay_us = arrived_us

    def replayed(self, now_us: int) -> bool:
        """Return whether what is heard is a log, sent again."""
        return _lately(self._replay_us, now_us)

    def replay_over(self, now_us: int) -> bool:
        """Return whether a log was heard last, and all of it."""
        if self._replay_us is None or self.replayed(now_us):
            return False
        return self._fresh_us is None or self._fresh_us < self._replay_us

    def alive(self, now_us: int) -> bool:
        """Return whether somebody speaks for the robot who is no log."""
        return _lately(self._fresh_us, now_us)


def _lately(at_us: int | None, now_us: int) -> bool:
    return at_us is not None and now_us - at_us <= REPLAY_MEMORY_S * US_PER_S

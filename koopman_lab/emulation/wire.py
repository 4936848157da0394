"""The wires between the board and its hardware, where a bus stands in for them."""

from __future__ import annotations

from koopman_lab.units import US_PER_S

REPLAY_S = 5.0
"""A message that was stamped so much earlier or later is a log's; no network takes so long."""

OLDEST_US = 1_000_000
"""Older than the newest message by more, it is a replayed log's; no wire takes so long."""
SILENCE_US = 50_000
"""After five motor ticks without a message an older one is a sender whose clock was set."""


def from_log(utime: int, now_us: int) -> bool:
    """Return whether a message stamped ``utime`` (us), heard at ``now_us``, comes from a log."""
    return abs(now_us - utime) > REPLAY_S * US_PER_S


class Wire:
    """Keeps what a log says off a wire on which somebody speaks.

    A log is replayed as it was recorded, motor duties and encoder counts included. On a real wire
    nobody but the other end can speak; on the bus the times of what it says tell it from a log.
    """

    def __init__(self) -> None:
        self._newest_us: int | None = None
        self._heard_us = 0

    def takes(self, utime: int, now_us: int) -> bool:
        """Return whether a message stamped ``utime``, which arrives at ``now_us``, is the wire's.

        Parameters
        ----------
        utime
            Of the message (us), by its sender's clock.
        now_us
            Time of the bus (us).
        """
        newest_us = self._newest_us
        if (
            newest_us is not None
            and utime < newest_us - OLDEST_US
            and now_us - self._heard_us < SILENCE_US
        ):
            return False
        self._newest_us, self._heard_us = utime, now_us
        return True

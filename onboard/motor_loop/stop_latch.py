"""Which stop holds the robot, and which releases are meant for it."""

from __future__ import annotations

import math

NO_STOP = 0
"""Stands for no stop in the place of a number: nothing holds the robot, or a sender knows none."""


class StopLatch:
    """Numbers the stops, so that a release needs no clock that the board agrees with.

    A stop's number is the board's own time (us) at which it came: nobody else knows it who has not
    heard this board say it after the stop. A release that names it counts whatever its sender's
    clock says; one of a replayed log names another. Each stop is one of its own, also where the
    robot is stopped already: a release that was meant for the one before does not undo it.

    Numbers only grow, also over a restart (:meth:`go_on_from`) and on a board whose clock was set
    back: no release of before can name a stop of today.

    A release of a sender that knows no numbers counts by its stamp alone.
    """

    def __init__(self) -> None:
        self.number = NO_STOP
        """Of the stop that holds the robot."""
        self.refused_releases = 0
        """Releases since start that were not meant for the stop under way."""
        self._ordered_us: float = -math.inf
        self._newest_number: float = -math.inf

    def go_on_from(self, number: int) -> None:
        """Give stops to come higher numbers than that of a stop of before."""
        self._newest_number = max(self._newest_number, number)

    def engage(self, now_us: int, stamped_us: int) -> None:
        """Hold the robot.

        Parameters
        ----------
        now_us
            Present time (us) of the board.
        stamped_us
            When the stop was ordered (us), by the board's clock.
        """
        self.number = self._next_number(now_us)
        # Nobody stops it in the future; so no stamp, however wrong, makes it stop for good. A stop
        # of long ago comes from a replayed log, whose releases are no newer for it.
        self._ordered_us = max(self._ordered_us, min(stamped_us, now_us))

    def release(self, number: int, stamped_us: int) -> bool:
        """Let the robot go if a release is meant for the stop that holds it; return whether so.

        Parameters
        ----------
        number
            Of the stop that is meant; :data:`NO_STOP` if the sender knows none.
        stamped_us
            When the release was ordered (us), by the board's clock.
        """
        if self.number == NO_STOP:
            return False
        known = number != NO_STOP
        is_meant = number == self.number if known else stamped_us >= self._ordered_us
        if is_meant:
            self.clear()
        else:
            self.refused_releases += 1
        return is_meant

    def _next_number(self, now_us: int) -> int:
        number = now_us if now_us > self._newest_number else int(self._newest_number) + 1
        # None has the number that stands for no stop.
        self._newest_number = number = number or 1
        return number

    def clear(self) -> None:
        """Let the robot go."""
        self.number = NO_STOP

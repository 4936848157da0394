"""Where a replay is in its log, and what a person does to it: no clock, no bus, no terminal.

All times are in us: those of the log count from its first event, those of the clock from anywhere.
"""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Sequence

SLOWEST, FASTEST = 1.0 / 64.0, 1024.0
"""Speeds that steering stays within: what a person can follow, and what a bus can carry."""
SHORTEST_LOOP_US = 100_000
"""A stretch that takes less time is repeated this often, and not as fast as the machine goes."""


class Playback:
    """The state of one replay; every event of the stretch is due once a pass.

    Parameters
    ----------
    due_us
        When each event is due after the first of the log (us), ascending; see
        :func:`~koopman_lab.replay.timed_replay.rhythm`.
    now_us
        Present time (us).
    speed
        Times as fast as it was recorded, above 0.
    start_us, end_us
        First and last moment of the log that are replayed (us); None for its end.
    loop
        Begin again at the end.
    paused
        Begin at rest.
    """

    def __init__(
        self,
        due_us: Sequence[int],
        now_us: int,
        *,
        speed: float = 1.0,
        start_us: int = 0,
        end_us: int | None = None,
        loop: bool = False,
        paused: bool = False,
    ) -> None:
        self.loop = loop
        self.speed = speed
        self.playing = not paused
        self.start_us = start_us
        self.end_us = max(start_us, due_us[-1] if due_us else 0) if end_us is None else end_us
        self._due_us = due_us
        self._first = bisect_left(due_us, self.start_us)
        self._stop = bisect_right(due_us, self.end_us)
        self._next = self._first
        self._anchor_us = now_us
        self._anchor_position_us = float(start_us)

    @property
    def next_event(self) -> int:
        """Return the number of the event that is due next."""
        return self._next

    @property
    def finished(self) -> bool:
        """Return whether nothing will ever be due again, unless a person goes back."""
        return self.playing and not self.loop and self._next >= self._stop

    def position_us(self, now_us: int) -> int:
        """Return which moment of the log has been reached (us)."""
        return round(min(self._unbounded_us(now_us), self.end_us))

    def take(self, now_us: int) -> range:
        """Return the numbers of the events that are due by now, which are then taken.

        In a loop those of one pass at most; the next call goes on.
        """
        if not self.playing:
            return range(0)
        if self.loop and self._next >= self._stop:
            self._begin_again_if_over(now_us)
        reached = bisect_right(self._due_us, self._unbounded_us(now_us))
        due = range(self._next, max(self._next, min(reached, self._stop)))
        self._next = due.stop
        return due

    def wait_us(self, now_us: int) -> int | None:
        """Return how long nothing is due (us); None as long as nobody steers."""
        if not self.playing or self.finished:
            return None
        ends = self._next >= self._stop
        at_us = self._loop_end_us if ends else self._due_us[self._next]
        return max(0, round((at_us - self._unbounded_us(now_us)) / self.speed))

    def lateness_us(self, event: int, now_us: int) -> int:
        """Return by how much an event is behind its time (us, of the clock)."""
        return round((self._unbounded_us(now_us) - self._due_us[event]) / self.speed)

    def toggle(self, now_us: int) -> None:
        """Pause, or go on."""
        self.set_playing(not self.playing, now_us)

    def set_playing(self, playing: bool, now_us: int) -> None:
        """Go on, or pause."""
        self._anchor(now_us)
        self.playing = playing

    def set_speed(self, speed: float, now_us: int) -> None:
        """Go on at another speed, within :data:`SLOWEST` and :data:`FASTEST`."""
        self._anchor(now_us)
        self.speed = min(max(speed, SLOWEST), FASTEST)

    def seek(self, position_us: int, now_us: int) -> None:
        """Go on at another moment of the log (us), within the stretch that is replayed."""
        position_us = min(max(position_us, self.start_us), self.end_us)
        self._next = min(max(bisect_left(self._due_us, position_us), self._first), self._stop)
        self._anchor_us, self._anchor_position_us = now_us, float(position_us)

    @property
    def _loop_end_us(self) -> float:
        """Return the moment of the log at which a pass is over (us)."""
        return max(self.end_us, self.start_us + SHORTEST_LOOP_US * self.speed)

    def _begin_again_if_over(self, now_us: int) -> None:
        """Begin the next pass exactly where this one ended, so that lateness never adds up."""
        over_us = self._unbounded_us(now_us) - self._loop_end_us
        if over_us < 0.0:
            return
        if over_us > self._loop_end_us - self.start_us:
            over_us = 0.0  # who is too slow for the speed catches up no whole pass
        self._next = self._first
        self._anchor_us, self._anchor_position_us = now_us, self.start_us + over_us

    def _unbounded_us(self, now_us: int) -> float:
        if not self.playing:
            return self._anchor_position_us
        return self._anchor_position_us + (now_us - self._anchor_us) * self.speed

    def _anchor(self, now_us: int) -> None:
        self._anchor_position_us = float(min(self._unbounded_us(now_us), self.end_us))
        self._anchor_us = now_us

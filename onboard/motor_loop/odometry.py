"""Wheel speeds from encoder counters."""

from __future__ import annotations

import math
from collections import deque
from typing import NamedTuple

from koopman_lab.units import HALF_RANGE, US_PER_S, wrap_counter

Speeds = tuple[float, float]
"""Speeds of both wheels (rad/s), (left, right)."""


class WheelSpeeds(NamedTuple):
    """Mean wheel speeds (rad/s) over a window, and the middle of that window (us)."""

    utime: int
    window_s: float
    left: float
    right: float


class Odometry:
    """Unwraps both counters and averages speeds over the newest samples.

    Parameters
    ----------
    counts_per_rev
        Counts for one turn of the wheel.
    window_s
        Length of the history to keep (s).
    """

    def __init__(self, counts_per_rev: int, window_s: float) -> None:
        self._rad_per_count = 2.0 * math.pi / counts_per_rev
        self._window_us = round(window_s * US_PER_S)
        self._samples: deque[tuple[int, int, int]] = deque()
        self._raw: tuple[int, int] | None = None

    def update(self, utime: int, left_count: int, right_count: int) -> None:
        """Take a sample; one that is not newer than the last is ignored.

        One that is older by more than the window tells of a clock that was set back. The samples
        before it are moved along, so that the speed goes on.
        """
        if self._raw is None:
            self._raw = (left_count, right_count)
            self._samples.append((utime, 0, 0))
            return
        samples = self._samples
        last_utime, left, right = samples[-1]
        if utime < last_utime - self._window_us:
            samples = self._move(utime - last_utime)
        elif utime <= last_utime:
            return
        left_before, right_before = self._raw
        left_step, right_step = left_count - left_before, right_count - right_before
        if abs(left_step) >= HALF_RANGE or abs(right_step) >= HALF_RANGE:
            # The difference of counters that have wrapped in between wraps, too.
            left_step, right_step = wrap_counter(left_step), wrap_counter(right_step)
        left, right = left + left_step, right + right_step
        self._raw = (left_count, right_count)
        oldest_us = utime - self._window_us
        samples.append((utime, left, right))
        # One sample older than the window stays, so that the mean covers all of it.
        while len(samples) > 2 and samples[1][0] <= oldest_us:
            samples.popleft()

    def _move(self, step_us: int) -> deque[tuple[int, int, int]]:
        last_us = self._samples[-1][0]
        period_us = last_us - self._samples[-2][0] if len(self._samples) > 1 else 1
        shift_us = step_us - period_us
        self._samples = deque((t + shift_us, left, right) for t, left, right in self._samples)
        return self._samples

    def newest(self) -> Speeds | None:
        """Return the speeds between the last two samples, or None before there are two."""
        samples = self._samples
        return None if len(samples) < 2 else self._speeds(samples[-2], samples[-1])

    def mean(self) -> WheelSpeeds | None:
        """Return the speeds over the window, or None before there are two samples."""
        samples = self._samples
        if len(samples) < 2:
            return None
        first, last = samples[0], samples[-1]
        (t0, _, _), (t1, _, _) = first, last
        return WheelSpeeds((t0 + t1) // 2, (t1 - t0) / US_PER_S, *self._speeds(first, last))

    def _speeds(self, older: tuple[int, int, int], newer: tuple[int, int, int]) -> Speeds:
        t0, left0, right0 = older
        t1, left1, right1 = newer
        scale = self._rad_per_count / ((t1 - t0) / US_PER_S)
        return scale * (left1 - left0), scale * (right1 - right0)

"""How far a robot has moved by one source, as a function of time."""

from __future__ import annotations

from collections import deque
from typing import NamedTuple

MEMORY_US = 1_500_000
"""So much is kept: what every window looks back, with what arrives late."""
LONGEST_STEP_US = 500_000
"""Over a longer silence nothing is known of the motion in between."""


class Motion(NamedTuple):
    """Motion in the robot's own frame: forward and to the left (m), turned (rad).

    ``path_m`` and ``swept_rad`` add up forward and backward, left and right.
    """

    forward_m: float
    sideways_m: float
    turned_rad: float
    path_m: float
    swept_rad: float


class MotionTrack:
    """Motion added up step by step, which can be asked for between any two times."""

    def __init__(self) -> None:
        # Each point is a time (us) and the five sums until then.
        self._points: deque[tuple[int, float, float, float, float, float]] = deque()

    def clear(self) -> None:
        """Forget all."""
        self._points.clear()

    @property
    def span_us(self) -> tuple[int, int] | None:
        """Return from when until when motion is known (us), None if none is."""
        points = self._points
        return (points[0][0], points[-1][0]) if points else None

    def add(self, until_us: int, forward_m: float, sideways_m: float, turned_rad: float) -> None:
        """Add the motion from the last time to ``until_us``; the first call only begins.

        Time that goes back, or leaps, tells of a clock that was set, or of a long silence: what was
        before it is forgotten.
        """
        points = self._points
        if points:
            last_us, forward, sideways, turned, path, swept = points[-1]
            if 0 < until_us - last_us <= LONGEST_STEP_US:
                points.append(
                    (
                        until_us,
                        forward + forward_m,
                        sideways + sideways_m,
                        turned + turned_rad,
                        path + abs(forward_m),
                        swept + abs(turned_rad),
                    )
                )
                while points[0][0] < until_us - MEMORY_US:
                    points.popleft()
                return
            if until_us == last_us:
                return
            points.clear()
        points.append((until_us, 0.0, 0.0, 0.0, 0.0, 0.0))

    def between(self, start_us: int, end_us: int) -> Motion:
        """Return the motion between two times (us) within those that are known."""
        _, a1, a2, a3, a4, a5 = self._at(start_us)
        _, b1, b2, b3, b4, b5 = self._at(end_us)
        return Motion(b1 - a1, b2 - a2, b3 - a3, b4 - a4, b5 - a5)

    def _at(self, at_us: int) -> tuple[float, ...]:
        points = self._points
        after = points[-1]
        for point in reversed(points):
            time_us = point[0]
            if time_us == at_us:
                return point
            if time_us < at_us:
                share = (at_us - time_us) / (after[0] - time_us) if after is not point else 0.0
                return tuple(a + share * (b - a) for a, b in zip(point, after, strict=True))
            after = point
        return points[0]

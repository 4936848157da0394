"""The segments that a calibration session has brought so far, as a person wants to see them."""

from __future__ import annotations

from typing import NamedTuple

import lcmtypes
from offboard.monitor.history import History

MOST_SEGMENTS = 1000
MOST_POINTS = 200
"""Of one segment; 10 s at the rate of the sampler."""

Point = tuple[float, float]


class SegmentPath(NamedTuple):
    """Where one segment led: points in m, and the basis input's index in the paper."""

    basis_index: int
    points: list[Point]


class CollectedSegments:
    """Gathers where the robot was under each basis input.

    A run counts when the sampler counts it; one that the sampler gave up is dropped, as in the
    data set (:func:`koopman_lab.data.segments.completed`).
    """

    def __init__(self) -> None:
        self.paths: History[SegmentPath] = History(MOST_SEGMENTS)
        self._run: tuple[int, int] | None = None
        self._points: list[Point] = []
        self._done = 0

    def take(self, state: lcmtypes.sampler_state_t, position: Point | None) -> None:
        """Take a state of the sampler, and where the robot is, if that is known."""
        if state.segments_done < self._done:  # another session
            self.paths.clear()
            self._run, self._points = None, []
        elif state.segments_done > self._done and self._run is not None and self._points:
            self.paths.append(SegmentPath(self._run[1], self._points))
            self._run, self._points = None, []
        self._done = state.segments_done
        run = (state.segment, state.basis_index) if state.phase == state.BASIS else None
        if run is not None and run != self._run:
            self._run, self._points = run, []
        if run is not None and position is not None and len(self._points) < MOST_POINTS:
            self._points.append(position)

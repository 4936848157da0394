"""Encoder counters, which count what reaches them."""

from __future__ import annotations

from koopman_lab.units import wrap_counter
from onboard.plant.wiring import AS_INTENDED, Wiring

Counts = tuple[int, int]
NONE_MISSED: Counts = (0, 0)


class Counters:
    """What both counters show: what they have missed, by a wiring that is wrong, stays missing."""

    def __init__(self) -> None:
        self._missed: Counts = NONE_MISSED
        self._true: Counts | None = None

    def read(self, true: Counts, wiring: Wiring) -> Counts:
        """Return what is shown where ``true`` would be; (left, right), wrapped at 32 bit.

        What has been counted since the last reading came through ``wiring``.
        """
        if wiring != AS_INTENDED and self._true is not None:
            self._miss(true, self._true, wiring)
        self._true = true
        if self._missed == NONE_MISSED:
            return true
        return (
            wrap_counter(true[0] - self._missed[0]),
            wrap_counter(true[1] - self._missed[1]),
        )

    def _miss(self, true: Counts, before: Counts, wiring: Wiring) -> None:
        left, right = (wrap_counter(count - old) for count, old in zip(true, before, strict=True))
        seen_left, seen_right = wiring.to_board(left, right)
        self._missed = (
            wrap_counter(self._missed[0] + left - seen_left),
            wrap_counter(self._missed[1] + right - seen_right),
        )

"""Encoder counters that a fault can hold."""

from __future__ import annotations

from koopman_lab.units import wrap_counter

Counts = tuple[int, int]
NONE_MISSED: Counts = (0, 0)
FREE = (False, False)


class Counters:
    """What both counters show: while one is stuck it misses counts, and then counts on."""

    def __init__(self) -> None:
        self._missed: Counts = NONE_MISSED
        self._shown: Counts | None = None

    def read(self, true: Counts, stuck: tuple[bool, bool]) -> Counts:
        """Return what is shown where ``true`` would be; (left, right), wrapped at 32 bit."""
        if self._shown is not None and stuck != FREE:
            left, right = (
                wrap_counter(count - shown) if held else missed
                for count, shown, held, missed in zip(
                    true, self._shown, stuck, self._missed, strict=True
                )
            )
            self._missed = left, right
        if self._missed == NONE_MISSED:
            self._shown = true
        else:
            self._shown = (
                wrap_counter(true[0] - self._missed[0]),
                wrap_counter(true[1] - self._missed[1]),
            )
        return self._shown

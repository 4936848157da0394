"""Whether the cameras send what a recorded session needs: all frames, each with a number.

Who speaks on their channel, and whether its numbers count at all, is another question:
:mod:`koopman_lab.bus.publishers`.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from typing import NamedTuple, Protocol

from koopman_lab.units import US_PER_S

FIRST_US, WINDOW_US = 1_000_000, 5_000_000
"""A rate is judged from the first second on, later over a window where hiccups count little."""
LARGEST_ERROR = 0.1
"""Of the rate, in which data sets would refuse the session as well."""


class Stamped(Protocol):
    """What a frame's message has."""

    utime: int
    sequence: int


class _Mark(NamedTuple):
    """The newest frame of a step, and how many with stamps of their own came until then."""

    utime: int
    sequence: int
    stamps: int


class CameraStream:
    """Counts frames, valid or not, by their stamps and by their numbers.

    Parameters
    ----------
    name
        Of the channel on the bus.
    rate_hz
        Of the cameras, as configured.
    """

    def __init__(self, name: str, rate_hz: float) -> None:
        self._name = name
        self._rate_hz = rate_hz
        self._marks: deque[_Mark] = deque()
        self._utime = self._stamps = 0

    def take(self, messages: Sequence[Stamped]) -> None:
        """Take the messages since the last step, in order of arrival."""
        if not messages:
            return
        utime, stamps = self._utime, self._stamps
        for message in messages:
            if message.utime != utime:
                utime, stamps = message.utime, stamps + 1
        self._utime, self._stamps = utime, stamps
        marks = self._marks
        if marks and not 0 <= utime - marks[-1].utime <= WINDOW_US:
            marks.clear()  # its clock was set, or it was silent
        marks.append(_Mark(utime, messages[-1].sequence, stamps))
        while marks[0].utime < utime - WINDOW_US:
            marks.popleft()

    def complaint(self) -> str | None:
        """Return in words what is wrong with the stream, None if nothing is.

        Before a second of it was heard that is not known.
        """
        if not self._marks:
            return f"{self._name}: no camera frames"
        first, last = self._marks[0], self._marks[-1]
        passed_us, stamps = last.utime - first.utime, last.stamps - first.stamps
        if passed_us < FIRST_US:
            return f"{self._name}: the rate of the cameras is being measured"
        rate_hz, counted = stamps * US_PER_S / passed_us, last.sequence - first.sequence
        if abs(rate_hz / self._rate_hz - 1.0) > LARGEST_ERROR:
            return (
                f"{self._name}: {rate_hz:.0f} frames a second, mocap.rate_hz says "
                f"{self._rate_hz:g}; set the rate of the cameras or of the configuration, or see "
                "whether the machine is overloaded"
            )
        if abs(counted - stamps) > LARGEST_ERROR * stamps:
            return (
                f"{self._name}: sequence counts {counted} in {stamps} frames; the camera bridge "
                "must count each frame once"
            )
        return None

"""The gate for times of another machine: which stamps can be used at all, and what else is said.

A stamp is only a number that somebody sent. Where it goes into a computation, a window, a loop or
a buffer it must lie about now, or it makes these endless, or empty. How *young* it must be to be
acted on is another, narrower question (:mod:`koopman_lab.bus.age`).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

from koopman_lab.bus.age import is_current
from koopman_lab.bus.channel import Channel
from koopman_lab.units import US_PER_S

NO_CLOCK_US = 2**61
"""Beyond this it is no clock; below, differences of any two fit into 64 bits."""
SAID_US = US_PER_S
"""So long after a stamp that was refused its clock is still named."""
LONG_S = 100.0
"""From here on tenths of a second say nothing."""
UNITS = (("ms", 1e3), ("s", 1e6), ("ns", 1e-3))
"""In which stamps come by mistake, and what makes us of them."""


class Inlet(NamedTuple):
    """What is plausible of the stamps of one channel.

    Attributes
    ----------
    clock
        Whose time it is, in words.
    ahead_us, behind_us
        How far a stamp may lie after and before now (us), by the clock of who listens.
    """

    clock: str
    ahead_us: int = US_PER_S
    behind_us: int = US_PER_S


INLETS: Mapping[str, Inlet] = {
    # What waited for a process that stood still is counted, though nobody drives by it.
    "MOCAP_POSE": Inlet("camera clock", behind_us=5 * US_PER_S),
    "WHEEL_STATE": Inlet("onboard clock"),
    "ONBOARD_STATUS": Inlet("onboard clock"),
    "LOGGER_STATUS": Inlet("logger's clock", ahead_us=2 * US_PER_S, behind_us=2 * US_PER_S),
    "ENCODER": Inlet("motor driver's clock"),
    "PLANT_TRUTH": Inlet("plant's clock"),
}
"""By channel: all whose stamps anybody computes with. Of orders (commands, goals, stops, faults)
only the age is looked at, of heartbeats and reports not even that."""


class StampGate:
    """Admits the stamps of one channel that lie about now.

    Parameters
    ----------
    channel
        Its row in :data:`INLETS` says what is plausible.
    """

    def __init__(self, channel: Channel[Any]) -> None:
        self.refused = 0
        """How many stamps were not admitted."""
        self._clock, self._ahead_us, self._behind_us = INLETS[channel.suffix]
        self._stamped_us = 0
        self._new_us: int | None = None

    def admits(self, stamped_us: int, now_us: int) -> bool:
        """Return whether a stamp (us) can be used that arrives now (us)."""
        if -self._behind_us <= stamped_us - now_us <= self._ahead_us:
            return True
        self.refused += 1
        if stamped_us != self._stamped_us or self._new_us is None:
            self._stamped_us, self._new_us = stamped_us, now_us
        return False

    def complaint(self, now_us: int) -> str:
        """Return in words how wrong the clock is by the newest stamps; empty if it is not.

        A stamp that is repeated tells of no clock that runs.
        """
        new_us = self._new_us
        if new_us is None or not is_current(new_us, now_us, SAID_US):
            return ""
        return clock_text(self._clock, self._stamped_us, new_us)


def clock_text(clock: str, stamped_us: int, now_us: int) -> str:
    """Return in words how wrong a clock is whose stamp (us) arrives now (us)."""
    for unit, factor in UNITS:
        if now_us and abs(stamped_us * factor / now_us - 1.0) < 0.01:
            return f"the {clock} stamps in {unit} instead of us"
    off_s = (stamped_us - now_us) / US_PER_S
    side = "ahead of" if off_s > 0 else "behind"
    digits = 0 if abs(off_s) >= LONG_S else 1
    return f"the {clock} is {abs(off_s):.{digits}f} s {side} this computer's clock"

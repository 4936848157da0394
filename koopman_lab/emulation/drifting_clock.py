"""The clock of a simulated board, which is wrong by an offset and a drift."""

from __future__ import annotations

from koopman_lab.config.simulation import BoardClock
from koopman_lab.emulation.faults import Faults
from koopman_lab.units import PPM, US_PER_S


class DriftingClock:
    """Goes wrong by an offset and a drift, and steps only if a fault sets it.

    Parameters
    ----------
    settings
        Offset and drift.
    start_us
        Time of the bus (us) at which it is wrong by exactly the offset.
    faults
        What goes wrong with the board.
    """

    def __init__(self, settings: BoardClock, start_us: int, faults: Faults) -> None:
        self._offset_us = round(settings.offset_s * US_PER_S)
        self._drift = settings.drift_ppm * PPM
        self._start_us = start_us
        self._faults = faults

    def read(self, bus_us: int) -> int:
        """Return what the clock shows (us) at a time of the bus (us)."""
        faults = self._faults
        # Asked for every tick and message: a call would cost more than the rest of this.
        effects = faults.effects if bus_us < faults.change_us else faults.at(bus_us)
        return (
            bus_us
            + self._offset_us
            + round((bus_us - self._start_us) * self._drift)
            + effects.clock_jump_us
        )

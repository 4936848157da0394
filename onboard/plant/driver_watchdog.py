"""The watchdog of the simulated motor drivers, which brake when commands stop coming."""

from __future__ import annotations

import math

from koopman_lab.units import US_PER_S


class DriverWatchdog:
    """Notices that the onboard program is gone: then nobody else could stop the motors.

    Parameters
    ----------
    timeout_s
        Silence after which the drivers brake.
    """

    def __init__(self, timeout_s: float) -> None:
        self.due_us: float = math.inf
        """When the drivers lose patience (us); infinite before the first command, and after."""
        self._timeout_us = round(timeout_s * US_PER_S)

    def hear(self, now_us: int) -> None:
        """Take note of a command."""
        self.due_us = now_us + self._timeout_us

    def brake(self) -> int:
        """Return when patience was lost (us), once per silence."""
        assert self.due_us < math.inf  # so the caller has seen
        due_us, self.due_us = int(self.due_us), math.inf
        return due_us

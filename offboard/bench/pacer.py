"""A node that only ticks, to show how regularly this machine wakes a process."""

from __future__ import annotations

from koopman_lab.bus.node import Port
from koopman_lab.config.schema import LabConfig


class Pacer:
    """Ticks as fast as the motor loop, at its priority, and does nothing."""

    name = "pacer"

    def __init__(self, config: LabConfig) -> None:
        self._rate_hz = config.motor_loop.rate_hz

    def attach(self, port: Port) -> None:
        """Set the timer."""
        port.every(self._rate_hz, lambda _: None)

    def close(self) -> None:
        """Nothing is held."""

"""The motor drivers' own watchdog."""

from __future__ import annotations

from koopman_lab.units import US_PER_S


class Driver:
    """Notices that the onboard program is gone: then nobody else could stop the motors.

    Parameters
    ----------
    timeout_s
        Silence after which the drivers brake.
    """

    def __init__(self, timeout_s: float) -> None:
        self._timeout_us = round(timeout_s * US_PER_S)
        self._due_us: int | None = None

    def hear(self, now_us: int) -> None:
        """Take note of a command."""
        self._due_us = now_us + self._timeout_us

    def silent_since(self, now_us: int) -> int | None:
        """Return, once per silence, when the drivers lost patience (us); None before that."""
        if self._due_us is None or now_us < self._due_us:
            return None
        due_us, self._due_us = self._due_us, None
        return due_us

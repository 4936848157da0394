"""Whether a program that drives a robot has stood still, so that what it planned is out of date."""

from __future__ import annotations

from koopman_lab.units import US_PER_S


class Wakefulness:
    """Watches the time between steps, by a clock that counts also while the computer sleeps.

    Parameters
    ----------
    limit_s
        Longest time between two steps (s).

    Attributes
    ----------
    complaint
        What has happened, in words; None as long as nothing has. Once said it stays.
    """

    def __init__(self, limit_s: float) -> None:
        self.complaint: str | None = None
        self._limit_s, self._limit_us = limit_s, round(limit_s * US_PER_S)
        self._stepped_us: int | None = None

    def step(self, now_us: int) -> None:
        """Take the time of a step."""
        before_us, self._stepped_us = self._stepped_us, now_us
        if before_us is not None and now_us - before_us > self._limit_us:
            self.complaint = (
                f"this program stood still for {(now_us - before_us) / US_PER_S:.1f} s (at most "
                f"{self._limit_s:g} s, commander.standstill_limit_s): it was stopped, the computer "
                "slept, or is too busy; see where the robot is, then start again"
            )

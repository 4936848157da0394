"""Finds what makes driving unsafe: an empty battery, silent encoders, a wheel that stands."""

from __future__ import annotations

from collections.abc import Sequence
from enum import IntEnum

from koopman_lab.config import schema
from koopman_lab.units import US_PER_S

LEFT, RIGHT = 0, 1
OLDEST_US = 30_000
"""Counters that are older, three ticks, say nothing about a wheel."""


class Fault(IntEnum):
    """What was found; the numbers are those of ``onboard_status_t``."""

    NO_FAULT = 0
    BATTERY_LOW = 1
    ENCODERS_SILENT = 2
    LEFT_WHEEL_STUCK = 3
    RIGHT_WHEEL_STUCK = 4


class Health:
    """Judges tick by tick; each finding must persist for its configured time.

    A stuck encoder and a blocked motor look the same from here: a wheel is driven and its counter
    stands still. Both stop the robot.
    """

    def __init__(self, settings: schema.Health) -> None:
        self._settings = settings
        self._good_since_us: dict[Fault, int] = {}

    def reset(self) -> None:
        """Forget the past."""
        self._good_since_us.clear()

    def hears(self, encoder_age_us: int | None) -> bool:
        """Return whether the newest encoder message (age in us) is young enough to drive by."""
        timeout_us = self._settings.encoder_timeout_s * US_PER_S
        return encoder_age_us is not None and encoder_age_us <= timeout_us

    def check(
        self,
        now_us: int,
        battery_v: float | None,
        encoder_age_us: int | None,
        duties: Sequence[float],
        speeds: Sequence[float],
    ) -> Fault:
        """Return what is wrong now.

        Parameters
        ----------
        now_us
            Onboard time.
        battery_v
            Newest battery voltage (V), None before the first.
        encoder_age_us
            Age of the newest encoder message (us), None before the first.
        duties
            Duties of the last tick, (left, right).
        speeds
            Measured wheel speeds (rad/s), (left, right).
        """
        s = self._settings
        silent = not self.hears(encoder_age_us)
        fresh = encoder_age_us is not None and encoder_age_us < OLDEST_US
        stuck = [
            fresh and abs(duty) > s.stuck_duty and speed == 0.0
            for duty, speed in zip(duties, speeds, strict=True)
        ]
        findings = (
            (Fault.ENCODERS_SILENT, silent and any(duties), 0.0),
            (Fault.BATTERY_LOW, battery_v is not None and battery_v < s.battery_low_v, s.battery_s),
            (Fault.LEFT_WHEEL_STUCK, stuck[LEFT], s.stuck_s),
            (Fault.RIGHT_WHEEL_STUCK, stuck[RIGHT], s.stuck_s),
        )
        for fault, bad, patience_s in findings:
            if not bad:
                self._good_since_us[fault] = now_us
            elif now_us - self._good_since_us.setdefault(fault, now_us) >= patience_s * US_PER_S:
                return fault
        return Fault.NO_FAULT

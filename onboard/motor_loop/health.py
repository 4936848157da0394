"""Finds what makes driving unsafe: an empty battery, silent encoders, a wheel that stands."""

from __future__ import annotations

from collections.abc import Sequence
from enum import IntEnum

from koopman_lab.config import motor_loop
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


FAULTS = len(Fault)
NO_FAULT = Fault.NO_FAULT


class Health:
    """Judges tick by tick; each finding must persist for its configured time.

    A stuck encoder and a blocked motor look the same from here: a wheel is driven and its counter
    stands still. Both stop the robot, the sooner the harder the wheel is driven: with a stuck
    encoder the speed controller sees no speed and drives ever harder.
    """

    def __init__(self, settings: motor_loop.Health) -> None:
        self._timeout_us = settings.encoder_timeout_s * US_PER_S
        self._battery_low_v = settings.battery_low_v
        self._battery_us = settings.battery_s * US_PER_S
        self._stuck_duty = settings.stuck_duty
        self._stuck_effort_us = settings.stuck_duty * settings.stuck_s * US_PER_S
        self._checked_us: int | None = None
        self.reset()

    def reset(self) -> None:
        """Forget the past."""
        self._good_since_us: list[int | None] = [None] * FAULTS
        self._efforts_us = [0.0, 0.0]

    def hears(self, encoder_age_us: int | None) -> bool:
        """Return whether the newest encoder message (age in us) is young enough to drive by."""
        return encoder_age_us is not None and abs(encoder_age_us) <= self._timeout_us

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
        silent = not self.hears(encoder_age_us) and any(duties)
        low = battery_v is not None and battery_v < self._battery_low_v
        fresh = encoder_age_us is not None and abs(encoder_age_us) < OLDEST_US
        left_idle = fresh and speeds[LEFT] == 0.0 and abs(duties[LEFT]) > self._stuck_duty
        right_idle = fresh and speeds[RIGHT] == 0.0 and abs(duties[RIGHT]) > self._stuck_duty
        before_us, self._checked_us = self._checked_us, now_us
        if not (silent or low or left_idle or right_idle):
            self._good_since_us = [now_us] * FAULTS
            self._efforts_us = [0.0, 0.0]
            return NO_FAULT
        # A clock that is set makes no time pass.
        passed_us = 0 if before_us is None else min(OLDEST_US, max(0, now_us - before_us))
        findings = (
            (Fault.ENCODERS_SILENT, silent, 0.0),
            (Fault.BATTERY_LOW, low, self._battery_us),
            (Fault.LEFT_WHEEL_STUCK, self._is_strained(LEFT, left_idle, duties, passed_us), 0.0),
            (Fault.RIGHT_WHEEL_STUCK, self._is_strained(RIGHT, right_idle, duties, passed_us), 0.0),
        )
        for fault, bad, patience_us in findings:
            since_us = self._good_since_us[fault]
            # A clock that was set back must not lengthen the patience.
            if not bad or since_us is None or since_us > now_us:
                since_us = self._good_since_us[fault] = now_us
            if bad and now_us - since_us >= patience_us:
                return fault
        return NO_FAULT

    def _is_strained(self, wheel: int, idle: bool, duties: Sequence[float], passed_us: int) -> bool:
        """Add up a wheel's duty over the time in which it should turn and does not."""
        effort_us = self._efforts_us[wheel] + abs(duties[wheel]) * passed_us if idle else 0.0
        self._efforts_us[wheel] = effort_us
        return effort_us >= self._stuck_effort_us

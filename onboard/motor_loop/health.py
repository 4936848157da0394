"""Finds what makes driving unsafe: battery, silent encoders, wheels that do not as they should."""

from __future__ import annotations

from collections.abc import Sequence

from koopman_lab.bus.age import is_current
from koopman_lab.bus.motor_loop_faults import Fault
from koopman_lab.bus.replay_guard import SILENCE_US
from koopman_lab.config.motor_loop import MotorLoop
from koopman_lab.geometry.planar import TAU
from koopman_lab.units import US_PER_S
from onboard.motor_loop.wheel_pair import LEFT, RIGHT
from onboard.motor_loop.wheels_plausibility import WheelsPlausibility

OLDEST_US = 30_000
"""Counters that are older, three ticks, say nothing about a wheel."""
FOLLOW_US = 2 * SILENCE_US
"""After a pause, or when the clock was set, it takes this long at most until the motors follow:
their driver may take the board for another sender at first."""
FAULTS = len(Fault)
NO_FAULT = Fault.NO_FAULT


class Health:
    """Judges tick by tick; each finding must persist for its time.

    A stuck encoder and a blocked motor look the same from here: a wheel is driven and its counter
    stands still. Both stop the robot, the sooner the harder the wheel is driven: with a stuck
    encoder the speed controller sees no speed and drives ever harder. A wheel that turns, but not
    as it should, is :class:`WheelsPlausibility`'s affair.

    Attributes
    ----------
    wheels
        Judges wheels that turn.

    Parameters
    ----------
    settings
        Limits and patience, counts per turn, rate of ticks.
    fastest_rad_per_s
        Largest set-point of a wheel.
    """

    def __init__(self, settings: MotorLoop, fastest_rad_per_s: float) -> None:
        health = settings.health
        self._timeout_us = health.encoder_timeout_s * US_PER_S
        self._oldest_us = min(OLDEST_US, self._timeout_us)
        self._battery_low_v = health.battery_low_v
        self._battery_us = health.battery_s * US_PER_S
        self._stuck_duty = health.stuck_duty
        self._stuck_effort_us = health.stuck_duty * health.stuck_s * US_PER_S
        one_count_rad_per_s = TAU / settings.encoder_counts_per_rev * settings.rate_hz
        full_duty_rad_per_s = settings.pid.feed_forward_full_duty_rad_per_s
        self.wheels = WheelsPlausibility(
            one_count_rad_per_s, full_duty_rad_per_s, fastest_rad_per_s
        )
        self._checked_us: int | None = None
        self._read_us: int | None = None
        self.reset()

    def reset(self, follow_us: int = 0) -> None:
        """Forget the past; for ``follow_us`` no wheel is expected to do what its motor is told."""
        self._follow_us = follow_us
        self._all_good_us: int | None = None
        self._settle()
        self.wheels.reset()

    def _settle(self) -> None:
        """Forget what was doubted."""
        self._in_doubt = False
        self._good_since_us: list[int | None] = [None] * FAULTS
        self._efforts_us = [0.0, 0.0]

    def hears(self, encoder_us: int | None, now_us: int) -> bool:
        """Return whether the newest encoder message is young enough to drive by."""
        return encoder_us is not None and is_current(encoder_us, now_us, self._timeout_us)

    def check(
        self,
        now_us: int,
        battery_v: float | None,
        encoder_us: int | None,
        duties: Sequence[float],
        speeds: Sequence[float],
        setpoints: Sequence[float],
    ) -> Fault:
        """Return what is wrong now.

        Parameters
        ----------
        now_us
            Onboard time.
        battery_v
            Newest battery voltage (V), None before the first.
        encoder_us
            When the newest encoder message was stamped (us), None before the first.
        duties
            Duties of the last tick, (left, right).
        speeds
            Measured wheel speeds (rad/s), (left, right), the mean of the last tick.
        setpoints
            Wheel speeds that the last tick was to bring (rad/s), (left, right).
        """
        before_us, self._checked_us = self._checked_us, now_us
        low = battery_v is not None and battery_v < self._battery_low_v
        silent = left_idle = right_idle = False
        if encoder_us is not None and is_current(encoder_us, now_us, self._oldest_us):
            if encoder_us != self._read_us:
                fault = self._contradiction(encoder_us, duties, speeds, setpoints)
                if fault:
                    return fault
            if 0.0 in speeds:
                left_idle = speeds[LEFT] == 0.0 and abs(duties[LEFT]) > self._stuck_duty
                right_idle = speeds[RIGHT] == 0.0 and abs(duties[RIGHT]) > self._stuck_duty
        else:
            silent = not self.hears(encoder_us, now_us) and any(duties)
        if not (silent or low or left_idle or right_idle):
            self._all_good_us = now_us
            if self._in_doubt:
                self._settle()
            return NO_FAULT
        self._in_doubt = True
        # A clock that is set makes no time pass.
        passed_us = 0 if before_us is None else min(OLDEST_US, max(0, now_us - before_us))
        findings = (
            (Fault.ENCODERS_SILENT, silent, 0.0),
            (Fault.BATTERY_LOW, low, self._battery_us),
            (Fault.LEFT_WHEEL_STUCK, self._is_strained(LEFT, left_idle, duties, passed_us), 0.0),
            (Fault.RIGHT_WHEEL_STUCK, self._is_strained(RIGHT, right_idle, duties, passed_us), 0.0),
        )
        for fault, bad, patience_us in findings:
            since_us = self._good_since_us[fault] or self._all_good_us
            # A clock that was set back must not lengthen the patience.
            if not bad or since_us is None or since_us > now_us:
                since_us = self._good_since_us[fault] = now_us
            if bad and now_us - since_us >= patience_us:
                return fault
        return NO_FAULT

    def _contradiction(
        self,
        encoder_us: int,
        duties: Sequence[float],
        speeds: Sequence[float],
        setpoints: Sequence[float],
    ) -> Fault:
        """Judge the wheels by a new reading of the encoders; return what is wrong with one.

        Where a machine is too busy for the motor loop, for a driver or for the wire between them,
        readings come irregularly, and so do duties at the motors: there is nothing to compare.
        """
        before_us, self._read_us = self._read_us, encoder_us
        passed_us = 0 if before_us is None else encoder_us - before_us
        if not 0 < passed_us <= OLDEST_US:
            self.wheels.reset()
            return NO_FAULT
        if self._follow_us > 0:
            self._follow_us -= passed_us
            if self._follow_us > 0:
                self.wheels.reset()
                return NO_FAULT
        return self.wheels.judge(duties, setpoints, speeds, passed_us / US_PER_S)

    def _is_strained(self, wheel: int, idle: bool, duties: Sequence[float], passed_us: int) -> bool:
        """Add up a wheel's duty over the time in which it should turn and does not."""
        effort_us = self._efforts_us[wheel] + abs(duties[wheel]) * passed_us if idle else 0.0
        self._efforts_us[wheel] = effort_us
        return effort_us >= self._stuck_effort_us

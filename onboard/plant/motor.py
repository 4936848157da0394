"""One geared motor with its wheel."""

from __future__ import annotations

import math

from koopman_lab.config import schema


class Motor:
    """Wheel speed (rad/s) and angle (rad) under a duty.

    ``dc``: first-order lag towards the speed at which back-EMF balances the duty, with Coulomb
    friction that holds a resting wheel until the duty exceeds it. ``instantaneous`` and
    ``linear`` are the ideal drives of the paper's nominal equations: the speed belonging to the
    duty at once, or reached linearly within one motor tick.
    """

    def __init__(self, motor: schema.Motor, gain: float, tick_s: float) -> None:
        self.speed_rad_per_s = 0.0
        self.angle_rad = 0.0
        self.until_kink_s = math.inf
        """Time until the speed's course has a corner that a step must not cross."""
        self._drive = motor.drive
        self._full_speed = motor.no_load_speed_rad_per_s * gain
        self._lag_s = motor.time_constant_s
        self._friction = motor.friction_duty
        self._tick_s = tick_s
        self._duty = 0.0
        self._slope = 0.0

    def drive(self, duty: float) -> None:
        """Set the duty; the hardware limits it to [-1, 1]."""
        self._duty = min(1.0, max(-1.0, duty))
        target = self._duty * self._full_speed
        if self._drive == "instantaneous":
            self.speed_rad_per_s = target
        elif self._drive == "linear":
            self._slope = (target - self.speed_rad_per_s) / self._tick_s
            self.until_kink_s = self._tick_s

    def halt(self) -> None:
        """Stop the wheel at once, as a hand does that lifts the robot."""
        self.speed_rad_per_s = 0.0
        self._slope = 0.0
        self.until_kink_s = math.inf

    def advance(self, step_s: float) -> None:
        """Integrate one step that crosses no kink."""
        before = self.speed_rad_per_s
        if self._drive == "dc":
            self.speed_rad_per_s = self._dc_speed_after(step_s)
        elif self._drive == "linear":
            self._follow_ramp(step_s)
        self.angle_rad += 0.5 * (before + self.speed_rad_per_s) * step_s

    def _follow_ramp(self, step_s: float) -> None:
        self.speed_rad_per_s += self._slope * step_s
        self.until_kink_s -= step_s
        if self.until_kink_s <= 1e-12:
            # Land on the target itself, so that rounding does not add up over a run.
            self.speed_rad_per_s = self._duty * self._full_speed
            self._slope = 0.0
            self.until_kink_s = math.inf

    def _dc_speed_after(self, step_s: float) -> float:
        speed = self.speed_rad_per_s
        direction = math.copysign(1.0, speed) if speed else math.copysign(1.0, self._duty)
        if not speed and abs(self._duty) <= self._friction:
            return 0.0
        target = (self._duty - direction * self._friction) * self._full_speed
        after = target + (speed - target) * math.exp(-step_s / self._lag_s)
        # Friction stops a wheel, it does not turn it round; the next step decides on that.
        return 0.0 if after * direction < 0.0 else after

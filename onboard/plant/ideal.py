"""The ideal drives of the paper's nominal equations."""

from __future__ import annotations

from koopman_lab.config.schema import LabConfig
from koopman_lab.units import US_PER_S


class IdealDrives:
    """Wheel speeds (rad/s) that follow the duties without mass, friction or battery.

    ``instantaneous``: the speed belonging to the duty at once. ``linear``: that speed is reached
    on a straight line within one motor tick, which makes the tick-wise set-points of acceleration
    commands the straight ramp of the second-order equations. The speed belonging to duty 1 is the
    one that the motor loop believes in.
    """

    def __init__(self, config: LabConfig) -> None:
        simulated = config.require_simulation().plant
        battery = simulated.battery
        self.left_rad_per_s = 0.0
        self.right_rad_per_s = 0.0
        self.until_kink_us: int | None = None
        self._battery_v = battery.empty_v + battery.state_of_charge * (
            battery.full_v - battery.empty_v
        )
        self._held_v: float | None = None
        self._full_speed = config.motor_loop.pid.feed_forward_full_duty_rad_per_s
        self._gain = simulated.motor.gain
        self._gain_left, self._gain_right = self._gain
        self._linear = simulated.motor.drive == "linear"
        self._tick_us = round(US_PER_S / config.motor_loop.rate_hz)
        self._targets = (0.0, 0.0)

    def drive(self, left_duty: float, right_duty: float) -> None:
        """Set the duties, each in [-1, 1]."""
        full = self._full_speed
        self._targets = (left_duty * full * self._gain_left, right_duty * full * self._gain_right)
        if self._linear:
            self.until_kink_us = self._tick_us
        else:
            self.left_rad_per_s, self.right_rad_per_s = self._targets

    def battery_v(self) -> float:
        """Return the voltage at the terminals."""
        return self._battery_v if self._held_v is None else self._held_v

    def halt(self) -> None:
        """Stop both wheels at once, as a hand does that lifts the robot."""
        self.left_rad_per_s = self.right_rad_per_s = 0.0
        self.until_kink_us = None

    def stall(self, left: bool, right: bool) -> None:
        """Lock these rotors at once, and no others; the others go on with the next duties."""
        self._gain_left = 0.0 if left else self._gain[0]
        self._gain_right = 0.0 if right else self._gain[1]
        self.left_rad_per_s *= not left
        self.right_rad_per_s *= not right
        to_left, to_right = self._targets
        self._targets = (to_left * (not left), to_right * (not right))

    def feed(self, battery_v: float | None) -> None:
        """Show this voltage, or the battery's own; the ideal drives do not feel it."""
        self._held_v = battery_v

    def advance(self, step_us: int) -> None:
        """Go on by a step that crosses no kink."""
        if self.until_kink_us is None:
            return
        if step_us == self.until_kink_us:
            # Land on the target itself, so that rounding does not add up over a run.
            self.left_rad_per_s, self.right_rad_per_s = self._targets
            self.until_kink_us = None
            return
        share = step_us / self.until_kink_us
        self.left_rad_per_s += share * (self._targets[0] - self.left_rad_per_s)
        self.right_rad_per_s += share * (self._targets[1] - self.right_rad_per_s)
        self.until_kink_us -= step_us

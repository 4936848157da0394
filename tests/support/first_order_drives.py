"""Motors that nobody has measured, in the place of those of the plant."""

import math

from koopman_lab.config.load import load_config

FULL_DUTY_RAD_PER_S = (10.0, 30.0, 60.0, 120.0)
LAGS_S = (0.02, 0.05, 0.1, 0.3)
FRICTION_DUTIES = (0.0, 0.1)
"""Of the motors that the gains of preset `real` are made for."""


class FirstOrderDrives:
    """Two first-order lags with Coulomb friction, solved exactly over each step.

    Parameters
    ----------
    full_rad_per_s
        Speed at full duty without friction.
    lag_s
        Time constant.
    friction_duty
        What friction takes of the duty; a wheel at rest needs a quarter more to break away.
    late_ticks
        How many motor ticks duties take to the motors.
    """

    until_kink_us = None

    def __init__(self, full_rad_per_s, lag_s, friction_duty=0.0, late_ticks=0):
        self.left_rad_per_s = self.right_rad_per_s = 0.0
        self._full, self._lag_s, self._friction = full_rad_per_s, lag_s, friction_duty
        self._on_the_way = [(0.0, 0.0)] * late_ticks
        self._duties = (0.0, 0.0)

    def battery_v(self):
        return 7.4

    def drive(self, left_duty, right_duty):
        self._on_the_way.append((left_duty, right_duty))
        self._duties = self._on_the_way.pop(0)

    def halt(self):
        self.left_rad_per_s = self.right_rad_per_s = 0.0

    def advance(self, step_us):
        left = math.exp(-step_us * 1e-6 / self._lag_s)
        self.left_rad_per_s = self._after(self.left_rad_per_s, self._duties[0], left)
        self.right_rad_per_s = self._after(self.right_rad_per_s, self._duties[1], left)

    def _after(self, speed, duty, left):
        if speed == 0.0 and abs(duty) <= 1.25 * self._friction:
            return 0.0
        sign = math.copysign(1.0, speed or duty)
        steady = self._full * (duty - sign * self._friction)
        after = steady + (speed - steady) * left
        # Friction stops a wheel, it does not turn it round.
        return after if after * sign > 0.0 else 0.0


def with_real_gains(robot, counts_per_rev=2400):
    """Return a simulated lab whose motor loop is that of preset `real`."""
    overrides = [f"motor_loop.encoder_counts_per_rev={counts_per_rev}"]
    real = load_config(robot=robot, preset="real", overrides=overrides)
    lab = load_config(robot=robot, overrides=overrides)
    parts = {"motor_loop": real.motor_loop, "controller": real.controller}
    return lab.model_copy(update=parts)

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
    stronger
        How many times as strong the left motor is as the right one; their mean is as said.
    more_friction_duty
        How much more friction takes at the right wheel.
    """

    until_kink_us = None

    def __init__(
        self,
        full_rad_per_s,
        lag_s,
        friction_duty=0.0,
        late_ticks=0,
        stronger=1.0,
        more_friction_duty=0.0,
    ):
        self.left_rad_per_s = self.right_rad_per_s = 0.0
        self._lag_s = lag_s
        right = 2.0 * full_rad_per_s / (1.0 + stronger)
        self._left = stronger * right, friction_duty
        self._right = right, friction_duty + more_friction_duty
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
        left_duty, right_duty = self._duties
        self.left_rad_per_s = after(self.left_rad_per_s, left_duty, left, *self._left)
        self.right_rad_per_s = after(self.right_rad_per_s, right_duty, left, *self._right)


def after(speed, duty, left, full, friction):
    """Return the speed after a step in which a share ``left`` of a deviation stays."""
    if speed == 0.0 and abs(duty) <= 1.25 * friction:
        return 0.0
    sign = math.copysign(1.0, speed or duty)
    steady = full * (duty - sign * friction)
    reached = steady + (speed - steady) * left
    # Friction stops a wheel, it does not turn it round.
    return reached if reached * sign > 0.0 else 0.0


def with_real_gains(robot, counts_per_rev=2400):
    """Return a simulated lab whose motor loop is that of preset `real`."""
    overrides = [f"motor_loop.encoder_counts_per_rev={counts_per_rev}"]
    real = load_config(robot=robot, preset="real", overrides=overrides)
    lab = load_config(robot=robot, overrides=overrides)
    parts = {"motor_loop": real.motor_loop, "controller": real.controller}
    return lab.model_copy(update=parts)

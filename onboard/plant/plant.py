"""The plant: motors, body and encoders, integrated on demand."""

from __future__ import annotations

import math

import numpy as np

from koopman_lab.config.schema import LabConfig
from koopman_lab.geometry import Pose, wrap_angle
from koopman_lab.units import US_PER_S
from onboard.plant.motor import Motor

COUNTER_RANGE = 1 << 32

# Three-point Gauss-Legendre on [0, 1]: exact for polynomials of degree five, so that a step with
# linearly changing wheel speeds follows the nominal equations to rounding.
_SPREAD = 0.5 * math.sqrt(0.6)
GAUSS = ((0.5 - _SPREAD, 5 / 18), (0.5, 8 / 18), (0.5 + _SPREAD, 5 / 18))


class Plant:
    """A differential-drive robot on the floor.

    Inside a step both wheel speeds change linearly; the contact is ideal rolling with the *true*
    wheel radii and track width, which differ from what the software believes
    (``config.plant.body``). Times are int64 microseconds; the plant never runs backwards.

    Parameters
    ----------
    config
        Geometry, motors and placement.
    rng
        Source of the placement error.
    """

    def __init__(self, config: LabConfig, rng: np.random.Generator) -> None:
        robot, body, motor = config.robot, config.plant.body, config.plant.motor
        tick_s = 1.0 / config.motor_loop.rate_hz
        left_factor, right_factor = body.wheel_radius_factor
        self.time_us: int | None = None
        self.pose = Pose(*config.plant.initial_pose)
        self.battery_v = config.plant.battery_v
        self.left = Motor(motor, motor.gain[0], tick_s)
        self.right = Motor(motor, motor.gain[1], tick_s)
        self._left_radius_m = robot.wheel_radius_m * left_factor
        self._right_radius_m = robot.wheel_radius_m * right_factor
        self._track_m = robot.track_width_m * body.track_width_factor
        self._counts_per_rad = config.motor_loop.encoder_counts_per_rev / (2.0 * math.pi)
        self._largest_step_s = config.plant.largest_step_s
        self._placement = config.plant.placement
        self._rng = rng

    def drive(self, left_duty: float, right_duty: float) -> None:
        """Apply motor duties (share of the battery voltage, in [-1, 1]) from now on."""
        self.left.drive(left_duty)
        self.right.drive(right_duty)

    def place(self, pose: Pose) -> None:
        """Place the robot by hand: at rest, within the accuracy of ``config.plant.placement``."""
        spread, turn = self._placement.position_m, self._placement.angle_rad
        e1, e2, e3 = self._rng.uniform(-1.0, 1.0, 3).tolist()
        self.pose = Pose(
            pose.x1 + spread * e1, pose.x2 + spread * e2, wrap_angle(pose.theta + turn * e3)
        )
        self.left.halt()
        self.right.halt()

    def advance(self, now_us: int) -> None:
        """Integrate up to ``now_us``; a time that has passed already changes nothing."""
        if self.time_us is None:
            self.time_us = now_us
        remaining_s = (now_us - self.time_us) / US_PER_S
        if remaining_s <= 0.0:
            return
        self.time_us = now_us
        while remaining_s > 1e-12:
            step_s = min(
                remaining_s, self._largest_step_s, self.left.until_kink_s, self.right.until_kink_s
            )
            self._step(step_s)
            remaining_s -= step_s

    def encoder_counts(self) -> tuple[int, int]:
        """Return both counters as the hardware holds them: whole counts, wrapped at 32 bit."""
        return self._count(self.left.angle_rad), self._count(self.right.angle_rad)

    def body_velocity(self) -> tuple[float, float]:
        """Return the true ``(v, omega)`` in m/s and rad/s."""
        return self._body(self.left.speed_rad_per_s, self.right.speed_rad_per_s)

    def _body(self, left: float, right: float) -> tuple[float, float]:
        left_m_per_s, right_m_per_s = left * self._left_radius_m, right * self._right_radius_m
        return 0.5 * (left_m_per_s + right_m_per_s), (right_m_per_s - left_m_per_s) / self._track_m

    def _step(self, step_s: float) -> None:
        v0, omega0 = self.body_velocity()
        self.left.advance(step_s)
        self.right.advance(step_s)
        v1, omega1 = self.body_velocity()
        if v0 == v1 == omega0 == omega1 == 0.0:
            return
        x1, x2, theta = self.pose
        dv, d_omega = v1 - v0, omega1 - omega0
        for at, weight in GAUSS:
            angle = theta + step_s * at * (omega0 + 0.5 * at * d_omega)
            distance = weight * step_s * (v0 + at * dv)
            x1 += distance * math.cos(angle)
            x2 += distance * math.sin(angle)
        self.pose = Pose(x1, x2, wrap_angle(theta + 0.5 * step_s * (omega0 + omega1)))

    def _count(self, angle_rad: float) -> int:
        counts = math.floor(angle_rad * self._counts_per_rad)
        return (counts + COUNTER_RANGE // 2) % COUNTER_RANGE - COUNTER_RANGE // 2

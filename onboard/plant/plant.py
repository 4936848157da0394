"""The plant: drives, body and encoders, integrated on demand."""

from __future__ import annotations

import math
from cmath import rect
from math import floor, pi
from typing import Protocol

import numpy as np

from koopman_lab.config.schema import LabConfig
from koopman_lab.geometry.planar import PlainPose, Pose, wrap_angle
from koopman_lab.units import US_PER_S, wrap_counter
from onboard.plant.drivetrain import Drivetrain
from onboard.plant.ideal import IdealDrives

# Two-point Gauss-Legendre on [0, 1]: exact for polynomials of degree three. With wheel speeds
# that change linearly its error over 10 s of 5 ms steps stays below 1e-9 m up to 3 rad/s.
EARLY, LATE = 0.5 - math.sqrt(1.0 / 12.0), 0.5 + math.sqrt(1.0 / 12.0)
HALF_EARLY, HALF_LATE = 0.5 * EARLY, 0.5 * LATE


class Drives(Protocol):
    """What turns the wheels."""

    left_rad_per_s: float
    right_rad_per_s: float
    until_kink_us: int | None
    """Time until the speeds' course has a corner that a step must not cross."""

    def battery_v(self) -> float:
        """Return the voltage at the terminals."""

    def drive(self, left_duty: float, right_duty: float) -> None:
        """Set the duties, each in [-1, 1]."""

    def halt(self) -> None:
        """Stop both wheels at once."""

    def stall(self, left: bool, right: bool) -> None:
        """Lock these rotors, and no others."""

    def feed(self, battery_v: float | None) -> None:
        """Hold the terminals at a voltage (V), or leave them to the battery."""

    def advance(self, step_us: int) -> None:
        """Integrate one step that crosses no kink."""


class Plant:
    """A differential-drive robot on the floor.

    The wheels roll with the *true* radii and track width, which differ from what the software
    believes (``config.simulation.plant.body``). Sideways the tyres give way: the body drifts
    outward by a slip angle proportional to the centripetal acceleration, as a tyre's lateral force
    grows with its slip angle. Times are int64 microseconds; the plant never runs backwards.

    Parameters
    ----------
    config
        Geometry, motors and placement.
    rng
        Source of the placement error.
    """

    def __init__(self, config: LabConfig, rng: np.random.Generator) -> None:
        robot, simulated = config.robot, config.require_simulation().plant
        body = simulated.body
        left_factor, right_factor = body.wheel_radius_factor
        left_m, right_m = robot.wheel_radius_m * left_factor, robot.wheel_radius_m * right_factor
        track_m = robot.track_width_m * body.track_width_factor
        self.time_us: int | None = None
        self.coordinates: PlainPose = simulated.initial_pose
        """True pose."""
        self.drives: Drives = (
            Drivetrain(config) if simulated.motor.drive == "dc" else IdealDrives(config)
        )
        self._left_rad = 0.0
        self._right_rad = 0.0
        self._rolling = (0.5 * left_m, 0.5 * right_m, left_m / track_m, right_m / track_m)
        self._slip = body.slip_angle_rad_s2_per_m
        self._counts_per_rad = config.motor_loop.encoder_counts_per_rev / (2.0 * math.pi)
        self._largest_step_us = max(1, round(simulated.largest_step_s * US_PER_S))
        self._placement = config.placement
        self._rng = rng

    @property
    def pose(self) -> Pose:
        """Return the true pose with named parts."""
        return Pose(*self.coordinates)

    def battery_v(self) -> float:
        """Return the voltage at the battery's terminals."""
        return self.drives.battery_v()

    def drive(self, left_duty: float, right_duty: float) -> None:
        """Apply motor duties (share of the battery voltage) from now on; hardware limits them."""
        if not (-1.0 <= left_duty <= 1.0 and -1.0 <= right_duty <= 1.0):
            left_duty, right_duty = (min(1.0, max(-1.0, d)) for d in (left_duty, right_duty))
        self.drives.drive(left_duty, right_duty)

    def place(self, pose: Pose) -> None:
        """Place the robot by hand: at rest, within the accuracy of ``config.placement``."""
        spread, turn = self._placement.position_m, self._placement.angle_rad
        e1, e2, e3 = self._rng.uniform(-1.0, 1.0, 3).tolist()
        self.coordinates = (
            pose.x1 + spread * e1,
            pose.x2 + spread * e2,
            wrap_angle(pose.theta + turn * e3),
        )
        self.drives.halt()

    def advance(self, now_us: int) -> int:
        """Integrate up to ``now_us`` and return where it is: what has passed changes nothing."""
        before_us = self.time_us
        if before_us is None:
            self.time_us = now_us
            return now_us
        remaining_us = now_us - before_us
        if remaining_us <= 0:
            return before_us
        self.time_us = now_us
        drives, largest_us = self.drives, self._largest_step_us
        while remaining_us:
            step_us = remaining_us if remaining_us < largest_us else largest_us
            kink_us = drives.until_kink_us
            if kink_us is not None and kink_us < step_us:
                step_us = kink_us
            self._step(drives, step_us)
            remaining_us -= step_us
        return now_us

    def encoder_counts(self) -> tuple[int, int]:
        """Return both counters as the hardware holds them: whole counts, wrapped at 32 bit."""
        per_rad = self._counts_per_rad
        return (
            wrap_counter(floor(per_rad * self._left_rad)),
            wrap_counter(floor(per_rad * self._right_rad)),
        )

    def body_velocity(self) -> tuple[float, float]:
        """Return the true ``(v, omega)`` in m/s and rad/s; v is along the robot."""
        left, right = self.drives.left_rad_per_s, self.drives.right_rad_per_s
        half_left, half_right, turn_left, turn_right = self._rolling
        return half_left * left + half_right * right, turn_right * right - turn_left * left

    def _step(self, drives: Drives, step_us: int) -> None:
        left, right = drives.left_rad_per_s, drives.right_rad_per_s
        drives.advance(step_us)
        new_left, new_right = drives.left_rad_per_s, drives.right_rad_per_s
        if not (left or right or new_left or new_right):
            return
        step_s = step_us / US_PER_S
        half_s = 0.5 * step_s
        self._left_rad += half_s * (left + new_left)
        self._right_rad += half_s * (right + new_right)
        # Inside a step both wheel speeds, and with them v and omega, change linearly.
        half_left, half_right, turn_left, turn_right = self._rolling
        v = half_left * left + half_right * right
        omega = turn_right * right - turn_left * left
        dv = half_left * new_left + half_right * new_right - v
        d_omega = turn_right * new_right - turn_left * new_left - omega
        x1, x2, theta = self.coordinates
        v_early, v_late = v + EARLY * dv, v + LATE * dv
        # To first order, a small slip angle turns the direction of motion, outward in the curve.
        slip = self._slip
        early = (
            theta
            + step_s * EARLY * (omega + HALF_EARLY * d_omega)
            - slip * abs(v_early) * (omega + EARLY * d_omega)
        )
        late = (
            theta
            + step_s * LATE * (omega + HALF_LATE * d_omega)
            - slip * abs(v_late) * (omega + LATE * d_omega)
        )
        theta += half_s * (omega + omega + d_omega)
        # As complex numbers, since one call then does for cos and sin.
        velocities = rect(v_early, early) + rect(v_late, late)
        self.coordinates = (
            x1 + half_s * velocities.real,
            x2 + half_s * velocities.imag,
            theta if abs(theta) < pi else wrap_angle(theta),
        )

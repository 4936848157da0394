"""The robot's state relative to the goal, from the cameras and the wheels."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable

import numpy as np
from numpy.typing import NDArray

from koopman_lab.bus.age import is_current
from koopman_lab.config.schema import LabConfig
from koopman_lab.geometry.planar import Pose, relative_to, wrap_angle
from koopman_lab.robots.body_drive import BodyDrive, Speeds
from koopman_lab.robots.table import robot_type
from koopman_lab.units import US_PER_S
from offboard.controller.input_history import InputHistory
from offboard.desk.measurements import Frame, WheelSpeeds

Advance = Callable[[NDArray[np.float64], NDArray[np.float64]], NDArray[np.float64]]
"""From a state and an input to the state one sampling time later."""


def oldest_wheels_s(config: LabConfig) -> float:
    """Return the age (s) over which wheel odometry counts as lost.

    It is a period and half a window old by its nature; the timeout comes on top.
    """
    loop = config.motor_loop
    by_nature_s = 1.0 / loop.wheel_state_rate_hz + 0.5 * loop.wheel_state_window_s
    return config.controller.tracking_timeout_s + by_nature_s


class StateEstimator:
    """Carries the newest measurement on to the time at which the next command acts.

    Where the state holds velocities, they are those of the wheels (paper, section 5.4); otherwise
    it is the pose alone. From the time of each measurement on, the commanded inputs carry
    the state forward: the velocities by themselves, the pose by the prediction model. That makes
    up for the delay of the loop, and bridges a loss of tracking. The angle is continued from frame
    to frame: it starts in (-pi, pi] and makes no jump of 2 pi.

    Parameters
    ----------
    config
        The lab.
    goal
        Origin of the state, in the inertial frame.
    advance
        The prediction model.

    Raises
    ------
    LabStateError
        If the state holds velocities that no two wheels tell.
    """

    def __init__(self, config: LabConfig, goal: Pose, advance: Advance) -> None:
        self.frame: Frame | None = None
        """The newest frame that could be used."""
        self.wheels: WheelSpeeds | None = None
        self.measured_us: int | None = None
        """Exposure time of the frame in the newest complete measurement."""
        self.is_measured = False
        """Whether the last update brought a measurement."""
        self._goal = goal
        self._advance = advance
        self._dt_s = config.controller.dt_s
        self._robot = robot_type(config.robot.kind)
        who = "a controller that takes velocities from wheels"
        self._drive = self._robot.on_two_wheels(who) if self._robot.speeds_at else None
        self._oldest_wheels_us = oldest_wheels_s(config) * US_PER_S
        self._theta: float | None = None
        self._measured: NDArray[np.float64] | None = None
        self._seen: tuple[Pose, Speeds | None] | None = None
        """The newest complete measurement, in the inertial frame."""
        self._inputs = InputHistory(self._robot.input_dim)

    def update(self, frames: Iterable[Frame], wheels: WheelSpeeds | None, now_us: int) -> None:
        """Take what has arrived since the last step; frames in order of arrival."""
        if wheels is not None and all(map(math.isfinite, wheels.velocity)):
            self.wheels = wheels
        self.is_measured = False
        new = None
        for frame in frames:
            usable = frame.valid and all(map(math.isfinite, frame.pose))
            if usable and (self.frame is None or frame.utime > self.frame.utime):
                self.frame = new = frame
        if new is not None:
            self._measure(new, now_us)

    def state(self, at_us: int) -> NDArray[np.float64] | None:
        """Return the state (n,) at a time (us), or None before the first measurement."""
        if self._measured is None or self.measured_us is None:
            return None
        x = self._measured
        for duration_s, u in self._inputs.between(self.measured_us, at_us, self._dt_s):
            # Within a sampling interval the motion is all but straight.
            x = x + duration_s / self._dt_s * (self._advance(x, u) - x)
        return x

    def move_goal(self, goal: Pose) -> None:
        """Give the state relative to another goal, that of the newest measurement as well."""
        self._goal = goal
        self._theta = None
        if self._seen is not None:
            self._measured = self._relative(*self._seen)

    def knows_speed(self, now_us: int) -> bool:
        """Return whether the newest wheel odometry is young enough to act on."""
        wheels = self.wheels
        return wheels is not None and is_current(wheels.utime, now_us, self._oldest_wheels_us)

    def is_complete(self, now_us: int) -> bool:
        """Return whether there is a state, and what it needs of the wheels still comes."""
        wheels_come = self._drive is None or self.knows_speed(now_us)
        return self._measured is not None and wheels_come

    def apply(self, u: NDArray[np.float64], from_us: int) -> None:
        """Note the input (m,) that acts from a time (us) until that of the next one."""
        self._inputs.add(from_us, u)

    def _measure(self, frame: Frame, now_us: int) -> None:
        velocity = None
        if self._drive is not None:
            if self.wheels is None or not self.knows_speed(now_us):
                return
            velocity = self._velocity_at(frame.utime, self.wheels, self._drive)
        self._seen = frame.pose, velocity
        self._measured = self._relative(frame.pose, velocity)
        self.measured_us = frame.utime
        self.is_measured = True

    def _relative(self, seen: Pose, velocity: Speeds | None) -> NDArray[np.float64]:
        """Return the state relative to the goal, its angle continued from the one before."""
        pose = relative_to(self._goal, seen)
        theta = pose.theta
        if self._theta is not None:
            theta = self._theta + wrap_angle(pose.theta - self._theta)
        self._theta = theta
        return self._robot.state((pose.x1, pose.x2, theta), velocity)

    def _velocity_at(self, at_us: int, wheels: WheelSpeeds, drive: BodyDrive) -> Speeds:
        velocity: Speeds = wheels.velocity
        for duration_s, u in self._inputs.between(wheels.utime, at_us, self._dt_s):
            velocity = drive.velocity_after(velocity, (float(u[0]), float(u[1])), duration_s)
        return velocity

"""The robot's state relative to the goal, from the cameras and the wheels."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from koopman_lab.config.schema import LabConfig
from koopman_lab.geometry import Pose, Velocity, relative_to, wrap_angle
from koopman_lab.units import US_PER_S

Advance = Callable[[NDArray[np.float64], NDArray[np.float64]], NDArray[np.float64]]
"""From a state and an input to the state one sampling time later."""


class Frame(NamedTuple):
    """A camera frame: time of exposure in us, the robot's pose in the inertial frame, validity."""

    utime: int
    pose: Pose
    valid: bool


class WheelSpeeds(NamedTuple):
    """Averaged wheel odometry: centre of the window in us, body velocity."""

    utime: int
    velocity: Velocity


class StateEstimator:
    """Measures the state where it can, and predicts it where it cannot.

    The kinematic robot's state is the pose. The second-order robot's velocities are those of the
    wheels (paper, section 5.4). The angle is continued from frame to frame: it starts in
    (-pi, pi] and makes no jump of 2 pi.

    Parameters
    ----------
    config
        The lab.
    goal
        Origin of the state, in the inertial frame.
    advance
        The prediction model.
    """

    def __init__(self, config: LabConfig, goal: Pose, advance: Advance) -> None:
        loop = config.motor_loop
        self.frame: Frame | None = None
        """The newest frame that could be used."""
        self.wheels: WheelSpeeds | None = None
        self.measured_us: int | None = None
        """Exposure time of the frame in the newest complete measurement."""
        self._goal = goal
        self._advance = advance
        self._uses_wheels = config.robot.kind == "dynamic"
        # A message is this old by its nature; only what comes on top is a loss.
        nature_s = 1.0 / loop.wheel_state_rate_hz + 0.5 * loop.wheel_state_window_s
        self._oldest_wheels_us = (config.controller.tracking_timeout_s + nature_s) * US_PER_S
        self._theta: float | None = None
        self._measured: NDArray[np.float64] | None = None
        self._inputs: list[NDArray[np.float64]] = []

    @property
    def is_measured(self) -> bool:
        """Whether the present state is measured, not predicted."""
        return self._measured is not None and not self._inputs

    def update(self, frames: Iterable[Frame], wheels: WheelSpeeds | None, now_us: int) -> None:
        """Take what has arrived since the last step; frames in order of arrival."""
        if wheels is not None and all(map(math.isfinite, wheels.velocity)):
            self.wheels = wheels
        new = None
        for frame in frames:
            usable = frame.valid and all(map(math.isfinite, frame.pose))
            if usable and (self.frame is None or frame.utime > self.frame.utime):
                self.frame = new = frame
        if new is not None:
            self._measure(new, now_us)

    def state(self) -> NDArray[np.float64] | None:
        """Return the present state (3,) or (5,), or None before the first measurement."""
        if self._measured is None:
            return None
        x = self._measured
        for u in self._inputs:
            x = self._advance(x, u)
        return x

    def knows_speed(self, now_us: int) -> bool:
        """Return whether the newest wheel odometry is young enough to act on."""
        return self.wheels is not None and now_us - self.wheels.utime <= self._oldest_wheels_us

    def apply(self, u: NDArray[np.float64]) -> None:
        """Note the input (2,) that acts from now until the next step."""
        self._inputs.append(u)

    def _measure(self, frame: Frame, now_us: int) -> None:
        pose = relative_to(self._goal, frame.pose)
        theta = pose.theta
        if self._theta is not None:
            theta = self._theta + wrap_angle(pose.theta - self._theta)
        self._theta = theta
        state = [pose.x1, pose.x2, theta]
        if self._uses_wheels:
            if self.wheels is None or not self.knows_speed(now_us):
                return
            state += self.wheels.velocity
        self._measured = np.array(state)
        self.measured_us = frame.utime
        self._inputs.clear()

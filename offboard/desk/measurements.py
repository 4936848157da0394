"""What is measured of a robot: camera frames and wheel odometry."""

from __future__ import annotations

from typing import NamedTuple

from koopman_lab.geometry.planar import Pose, Velocity


class Frame(NamedTuple):
    """A camera frame: time of exposure in us, the pose in the inertial frame, validity."""

    utime: int
    pose: Pose
    valid: bool


class WheelSpeeds(NamedTuple):
    """Averaged wheel odometry: centre of the window in us, body velocity."""

    utime: int
    velocity: Velocity

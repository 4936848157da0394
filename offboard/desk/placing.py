"""Placing the robot: the message that asks for it, and whether the cameras see it done."""

from __future__ import annotations

import math

import lcmtypes
from koopman_lab.config.schema import Placement
from koopman_lab.geometry.planar import Pose, relative_to

NOISE_M, NOISE_RAD = 0.005, 0.02
"""Beyond the accuracy of placing: many times the camera noise."""


def reset_message(pose: Pose, utime: int) -> lcmtypes.plant_reset_t:
    """Return the message that places the plant at a pose."""
    message = lcmtypes.plant_reset_t()
    message.utime = utime
    message.x1_m, message.x2_m, message.theta_rad = pose
    return message


def stands_at(pose: Pose, start: Pose, accuracy: Placement) -> bool:
    """Return whether a measured pose is one of a robot placed at ``start``."""
    deviation = relative_to(start, pose)
    # The accuracy holds for each axis of the inertial frame; turned, its diagonal can come along.
    return (
        math.hypot(deviation.x1, deviation.x2) <= math.sqrt(2.0) * accuracy.position_m + NOISE_M
        and abs(deviation.theta) <= accuracy.angle_rad + NOISE_RAD
    )

"""The message that sends a robot to a goal."""

from __future__ import annotations

import lcmtypes
from koopman_lab.geometry.planar import Pose


def goal_message(goal: Pose, utime: int) -> lcmtypes.goal_t:
    """Return the message that sends the robot to a goal."""
    message = lcmtypes.goal_t()
    message.utime = utime
    message.goal_x1_m, message.goal_x2_m, message.goal_theta_rad = goal
    return message

"""The message that sends a robot to a goal, and which goals are refused."""

from __future__ import annotations

import math

import lcmtypes
from koopman_lab.config.schema import Controller
from koopman_lab.errors import LabStateError
from koopman_lab.geometry.planar import Pose


def goal_message(goal: Pose, utime: int) -> lcmtypes.goal_t:
    """Return the message that sends the robot to a goal."""
    message = lcmtypes.goal_t()
    message.utime = utime
    message.goal_x1_m, message.goal_x2_m, message.goal_theta_rad = goal
    return message


def require_reachable(goal: Pose, settings: Controller) -> None:
    """Refuse a goal that is no pose, or outside the floor.

    Raises
    ------
    LabStateError
        With the goal, the bounds and the key that sets them.
    """
    if not all(map(math.isfinite, goal)):
        raise LabStateError("goal: a pose needs three numbers, x1 and x2 in m and an angle")
    area = settings.goal_area
    for name, value, (low, high) in (
        ("x1", goal.x1, area.x1_m),
        ("x2", goal.x2, area.x2_m),
    ):
        if not low <= value <= high:
            raise LabStateError(
                f"goal: {name} = {value:g} m is outside [{low:g}, {high:g}] m; choose another, "
                f"or enlarge controller.goal_area.{name}_m if the floor is free there"
            )

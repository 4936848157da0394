"""The message that sends a robot to a goal, and which goals are refused."""

from __future__ import annotations

import math

import lcmtypes
from koopman_lab.config.schema import Area
from koopman_lab.errors import LabStateError
from koopman_lab.geometry.planar import Pose


def goal_message(goal: Pose, utime: int) -> lcmtypes.goal_t:
    """Return the message that sends the robot to a goal."""
    message = lcmtypes.goal_t()
    message.utime = utime
    message.goal_x1_m, message.goal_x2_m, message.goal_theta_rad = goal
    return message


def require_on_floor(pose: Pose, floor: Area, what: str = "goal") -> None:
    """Refuse a pose that is none, or outside the floor.

    Parameters
    ----------
    pose
        In the inertial frame.
    floor
        Where the robot may be driven.
    what
        What the pose is, in a word for a person.

    Raises
    ------
    LabStateError
        With the pose, the bounds and the key that sets them.
    """
    if not all(map(math.isfinite, pose)):
        raise LabStateError(f"{what}: a pose needs three numbers, x1 and x2 in m and an angle")
    for name, value, (low, high) in (
        ("x1", pose.x1, floor.x1_m),
        ("x2", pose.x2, floor.x2_m),
    ):
        if not low <= value <= high:
            raise LabStateError(
                f"{what}: {name} = {value:g} m is outside [{low:g}, {high:g}] m; choose another, "
                f"or enlarge floor.{name}_m if the floor is free there"
            )

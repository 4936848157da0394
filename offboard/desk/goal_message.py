"""The message that sends a robot to a goal, and the order that repeats it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import lcmtypes
from koopman_lab.bus.channels import GOAL
from koopman_lab.config.schema import LabConfig
from koopman_lab.geometry.planar import Pose
from offboard.desk.floor import require_on_floor
from offboard.desk.orders import Order


def goal_message(goal: Pose, utime: int) -> lcmtypes.goal_t:
    """Return the message that sends the robot to a goal."""
    message = lcmtypes.goal_t()
    message.utime = utime
    message.goal_x1_m, message.goal_x2_m, message.goal_theta_rad = goal
    return message


def goal_order(
    goal: Pose, config: LabConfig, state: Callable[[], lcmtypes.mpc_state_t | None]
) -> Order[Any]:
    """Return the order to park somewhere else.

    Parameters
    ----------
    goal
        In the inertial frame.
    config
        Of the lab, for the bounds of the floor.
    state
        Returns the controller's newest step, None if it is silent.

    Raises
    ------
    UsageError
        If the goal is no pose, or outside the floor.
    """
    require_on_floor(goal, config.floor)

    def obeyed() -> bool:
        newest = state()
        return newest is not None and tuple(newest.goal) == tuple(goal)

    return Order(GOAL, lambda utime: goal_message(goal, utime), obeyed)

"""What the controller reports of each step: MPC_STATE, and a row of the trajectory."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import lcmtypes
from koopman_lab.bus.message_values import padded
from koopman_lab.geometry.planar import Pose
from koopman_lab.robots.robot_type import RobotType
from koopman_lab.studies.closed_loop import row
from offboard.controller.controller_step import Outputs
from offboard.desk.results import Row


class TrajectoryPoint(NamedTuple):
    """One step of the drive.

    ``utime`` in us; ``state`` relative to the goal and ``u`` in the units of the robot's states and
    inputs; ``value`` is the cost of the plan.
    """

    utime: int
    state: tuple[float, ...]
    u: tuple[float, ...]
    value: float


def trajectory_rows(robot: RobotType, points: Sequence[TrajectoryPoint]) -> tuple[Row, ...]:
    """Return the steps of a drive as they are written, with times in s since the first one."""
    first_us = points[0].utime if points else 0
    return tuple(
        tuple(row(robot, (p.utime - first_us) * 1e-6, p.state, p.u, p.value, no_speed=0.0))
        for p in points
    )


def mpc_state(outputs: Outputs, goal: Pose, solve_ms: float, utime: int) -> lcmtypes.mpc_state_t:
    """Return the message of one step; ``utime`` (us) is that of the command sent in it."""
    message = lcmtypes.mpc_state_t()
    message.utime = utime
    message.state = outputs.state
    message.goal = list(goal)
    message.state_in_goal_frame = padded(outputs.state_in_goal_frame, message.MOST_STATES)
    message.inputs, message.u = len(outputs.u), padded(outputs.u, message.MOST_INPUTS)
    message.value_function, message.stage_cost = outputs.value, outputs.stage_cost
    message.solve_ms = solve_ms
    message.iterations, message.solved = outputs.iterations, outputs.solved
    message.pose_age_us = 0 if outputs.pose_utime is None else utime - outputs.pose_utime
    message.horizon = len(outputs.predicted)
    message.predicted_x1_m = outputs.predicted[:, 0].tolist()
    message.predicted_x2_m = outputs.predicted[:, 1].tolist()
    return message

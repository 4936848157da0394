"""What the controller reports: each step on the bus, and how the run ended."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import lcmtypes
from koopman_lab.geometry.planar import Pose
from offboard.controller.controller import Outputs, Pause


class TrajectoryPoint(NamedTuple):
    """One step of the drive.

    ``utime`` in us; ``state`` relative to the goal in m, m, rad, m/s, rad/s (speeds zero for the
    kinematic robot); ``u`` in m/s, rad/s or m/s^2, rad/s^2; ``value`` is the cost of the plan.
    """

    utime: int
    state: tuple[float, ...]
    u: tuple[float, float]
    value: float


@dataclass(frozen=True)
class ParkOutcome:
    """How a parking run ended.

    Attributes
    ----------
    parked
        Whether the robot stood inside the parked bounds for long enough.
    state
        Name of the controller's state: WAIT, DRIVING, PARKED, TIME_LIMIT, FAILED or PAUSED.
    reason
        In words.
    final_pose
        Newest valid measured pose of the robot (that which the model is of) relative to the goal,
        None if there never was one.
    duration_s
        From the first driving step to the end of the drive.
    solve_ms
        Wall time of each driving step.
    pose_age_ms
        Age of the newest measured pose when the command of each driving step acts.
    steps
        Number of driving steps.
    pauses
        What stopped the robot for a while, in order.
    goal
        The last one, in the inertial frame.
    """

    parked: bool
    state: str
    reason: str
    final_pose: Pose | None
    duration_s: float
    solve_ms: list[float]
    pose_age_ms: list[float]
    steps: int
    pauses: list[Pause]
    goal: Pose


def mpc_state(outputs: Outputs, goal: Pose, solve_ms: float, utime: int) -> lcmtypes.mpc_state_t:
    """Return the message of one step; ``utime`` (us) is that of the command sent in it."""
    message = lcmtypes.mpc_state_t()
    message.utime = utime
    message.state = outputs.state
    message.goal = list(goal)
    message.state_in_goal_frame = outputs.state_in_goal_frame.tolist()
    message.u = list(outputs.u)
    message.value_function, message.stage_cost = outputs.value, outputs.stage_cost
    message.solve_ms = solve_ms
    message.iterations, message.solved = outputs.iterations, outputs.solved
    message.pose_age_us = 0 if outputs.pose_utime is None else utime - outputs.pose_utime
    message.horizon = len(outputs.predicted)
    message.predicted_x1_m = outputs.predicted[:, 0].tolist()
    message.predicted_x2_m = outputs.predicted[:, 1].tolist()
    return message

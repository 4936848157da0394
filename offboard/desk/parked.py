"""When a robot is at its goal, and when it stands."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from koopman_lab.config.controller import Controller
from koopman_lab.geometry.planar import wrap_angle
from koopman_lab.robots.robot_type import RobotType

REST_SPEED_M_PER_S = 0.01
REST_TURN_RAD_PER_S = 0.05
"""Slower than this the robot counts as standing; a few times what one encoder count makes."""


def is_at_rest(v: float, omega: float) -> bool:
    """Return whether a robot of this velocity (m/s, rad/s) stands."""
    return abs(v) <= REST_SPEED_M_PER_S and abs(omega) <= REST_TURN_RAD_PER_S


def is_inside(x: NDArray[np.float64], settings: Controller, robot: RobotType) -> bool:
    """Return whether a state is as near the goal as a parked robot's.

    Parameters
    ----------
    x
        State (n,) relative to the goal.
    settings
        The tolerances.
    robot
        Whose state it is; where it holds the velocity, the robot must stand as well.
    """
    largest_x1, largest_x2 = settings.parked_position_m
    return (
        abs(x[0]) <= largest_x1
        and abs(x[1]) <= largest_x2
        and abs(wrap_angle(float(x[2]))) <= settings.parked_angle_rad
        and (not robot.speeds_at or is_at_rest(*x[list(robot.speeds_at)]))
    )

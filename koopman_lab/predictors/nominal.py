"""The nominal equations as a predictor (paper, sections 3.1 and 3.2)."""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np

from koopman_lab.geometry.planar import ORIGIN, Pose
from koopman_lab.predictors.predictor import StatePrediction
from koopman_lab.robots.table import robot_type


class NominalPrediction(StatePrediction):
    """The nominal equations of a robot; see :class:`~.predictor.PredictionModel`.

    Parameters
    ----------
    robot
        Which robot, by its name.
    dt_s
        Sampling time in s.
    marker_offset
        Pose of the tracked frame on the robot.
    """

    def __init__(self, robot: str, dt_s: float, marker_offset: Pose = ORIGIN) -> None:
        self.robot = robot_type(robot)
        self.dt_s = dt_s
        self.marker_offset = marker_offset
        self.parameters = np.array([dt_s])

    def step(self, s: Any, u: Any, parameters: Any) -> Any:
        """Return the state one sampling time later."""
        states = [s[i] for i in range(self.state_dim)]
        inputs = [u[i] for i in range(self.input_dim)]
        return ca.vertcat(*self.robot.components(states, inputs, parameters[0], ca))

"""Plans without a steady error: what the model gets wrong is estimated and put into it.

A model learned from noisy data is a little wrong at rest too: it predicts a drift that is not
there, and a controller that believes it holds the robot a little beside the goal to make up for it.
What persists of the difference between prediction and measurement is added to every step of the
prediction, the classical way to offset-free predictive control (Pannocchia and Rawlings, AIChE
Journal 49, 2003). At the goal the model then says the truth, and to stand there costs nothing.
"""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from koopman_lab.config.controller import OffsetFree
from koopman_lab.geometry.planar import wrap_angle
from koopman_lab.predictors.predictor import PredictionModel
from koopman_lab.robots.robot_type import POSE_DIM

Array = NDArray[np.float64]


class DisturbedPrediction:
    """A prediction model of the state with a constant added to the pose in each step.

    Only the pose is corrected: in what stands behind it, speeds for one, the motors' lag would be
    taken for a disturbance.

    The constant is the last part of its parameters, zero to begin with.

    Parameters
    ----------
    model
        What is added to; it propagates the state itself.
    """

    disturbance_dim = POSE_DIM

    def __init__(self, model: PredictionModel) -> None:
        self._model = model
        self.parameters = np.concatenate([model.parameters, np.zeros(POSE_DIM)])

    def __getattr__(self, name: str) -> Any:
        """Return everything else as it is in the model itself."""
        return getattr(self._model, name)

    def step(self, s: Any, u: Any, parameters: Any) -> Any:
        """Return the state one sampling time later, the constant added to its pose."""
        size = self._model.parameters.size
        rest = ca.SX.zeros(self._model.state_dim - POSE_DIM)
        return self._model.step(s, u, parameters[:size]) + ca.vertcat(parameters[size:], rest)


class DisturbanceEstimator:
    """A slow mean of what the predictions of the pose were off by in a step.

    The mean forgets exponentially. What comes in is a difference of measured poses, so noise of the
    cameras all but cancels from step to step.

    Parameters
    ----------
    settings
        How slow, and how far it may go.
    dt_s
        Sampling time (s).
    """

    def __init__(self, settings: OffsetFree, dt_s: float) -> None:
        self.value = np.zeros(POSE_DIM)
        """The present estimate per step: m, m, rad."""
        self._share = dt_s / settings.time_constant_s
        x, theta = settings.largest_m_per_s, settings.largest_rad_per_s
        self._largest = dt_s * np.array([x, x, theta])

    def reset(self) -> None:
        """Forget."""
        self.value = np.zeros(POSE_DIM)

    def update(self, predicted: Array, measured: Array) -> Array:
        """Return the estimate after a step.

        Parameters
        ----------
        predicted
            State (n,) that the model with the present estimate expected.
        measured
            State (n,) that came.
        """
        error = (measured - predicted)[:POSE_DIM]
        error[2] = wrap_angle(float(error[2]))
        moved = self.value + self._share * error
        self.value = np.clip(moved, -self._largest, self._largest)
        return self.value

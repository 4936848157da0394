"""What the optimiser needs to know of a model, and trajectories of it."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Protocol

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from koopman_lab.config.schema import RobotKind
from koopman_lab.geometry import ORIGIN, Pose
from koopman_lab.koopman.model import BilinearModel
from koopman_lab.mpc.costs import StageCost
from koopman_lab.robot.models import nominal_model


class PredictionModel(Protocol):
    """A discrete-time model with zero-order hold on the input (paper, section 2.1).

    States are relative to the goal, in m, m, rad and, for the second-order robot, m/s, rad/s.
    """

    @property
    def robot_kind(self) -> RobotKind:
        """Which robot it describes."""

    @property
    def state_dim(self) -> int:
        """Number of states n: 3 (kinematic robot) or 5 (second-order robot)."""

    @property
    def dt_s(self) -> float:
        """Sampling time in s."""

    @property
    def marker_offset(self) -> Pose:
        """Pose of the tracked frame in the frame whose pose the states hold."""

    @property
    def parameters(self) -> NDArray[np.float64]:
        """The numbers that a step depends on, (P,).

        They stand apart so that what is compiled for one model serves all of its shape.
        """

    def step(self, x: Any, u: Any, parameters: Any) -> Any:
        """Return the state one sampling time later: CasADi SX (n,) and (2,) to (n,).

        The parameters are numbers (DM) or symbols (SX).
        """


class NominalPrediction:
    """The nominal equations as a prediction model (paper, sections 3.1 and 3.2).

    Parameters
    ----------
    kind
        Which robot.
    dt_s
        Sampling time in s.
    """

    def __init__(self, kind: RobotKind, dt_s: float) -> None:
        self.robot_kind: RobotKind = kind
        self.dt_s = dt_s
        self.marker_offset = ORIGIN
        self._model = nominal_model(kind)
        self.state_dim = self._model.state_dim
        self.parameters = np.array([dt_s])

    def step(self, x: Any, u: Any, parameters: Any) -> Any:
        """Return the state one sampling time later; see :class:`PredictionModel`."""
        states = [x[i] for i in range(self.state_dim)]
        return ca.vertcat(*self._model.components(states, [u[0], u[1]], parameters[0], ca))


class KoopmanPrediction:
    """A bilinear Koopman surrogate, reprojected in each step (paper, sections 2.2 and 5.4).

    Parameters
    ----------
    model
        Learned from data.
    """

    def __init__(self, model: BilinearModel) -> None:
        self.robot_kind = model.robot_kind
        self.state_dim = model.state_dim
        self.dt_s = model.dt_s
        self.marker_offset = model.marker_offset
        self.parameters = model.parameters
        self._step = model.casadi_step()

    def step(self, x: Any, u: Any, parameters: Any) -> Any:
        """Return the state one sampling time later; see :class:`PredictionModel`."""
        return self._step(x, u, parameters)


def load_prediction(path: Path) -> KoopmanPrediction:
    """Return the prediction model in a model file.

    Raises
    ------
    ModelError
        If the file is missing or damaged.
    """
    return KoopmanPrediction(BilinearModel.load(path))


class Rollout:
    """Simulates a model under a sequence of inputs and adds up the stage costs.

    The cost is that of the optimal control problem: H stages with inputs and one without.

    Parameters
    ----------
    model
        Of the robot.
    cost
        Of a stage.
    horizon
        Number of inputs H.
    """

    def __init__(self, model: PredictionModel, cost: StageCost, horizon: int) -> None:
        x, u = ca.SX.sym("x", model.state_dim), ca.SX.sym("u", 2)
        step = ca.Function("step", [x, u], [model.step(x, u, ca.DM(model.parameters))])
        self._step = step
        self._trajectory = step.mapaccum("trajectory", horizon)
        self._cost = cost
        self.horizon = horizon
        self.state_dim = model.state_dim

    def __call__(
        self, x0: NDArray[np.float64], inputs: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], float]:
        """Return the states (H + 1, n) that begin with ``x0`` (n,), and the sum of the costs.

        Parameters
        ----------
        x0
            State (n,).
        inputs
            Inputs (H, 2).
        """
        later = np.asarray(self._trajectory(x0, inputs.T)).T
        states = np.vstack([x0, later])
        value = np.sum(self._cost(states[:-1].T, inputs.T)) + self._cost(states[-1], np.zeros(2))
        return states, float(value)

    def advance(self, x: NDArray[np.float64], u: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the state (n,) one sampling time after ``x`` (n,) under ``u`` (2,)."""
        return np.asarray(self._step(x, u)).ravel()

"""What the optimiser needs to know of a model.

A model propagates a vector s by steps. That is the robot's state, or, without reprojection, the
vector psi of observables: lifted once at the start and never projected back, except where somebody
wants to know the state.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, Protocol

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from koopman_lab.config.schema import Controller
from koopman_lab.geometry.planar import ORIGIN, Pose
from koopman_lab.koopman.bilinear_model import BilinearModel
from koopman_lab.koopman.dictionary import Dictionary
from koopman_lab.mpc.costs import QuadraticInObservables, StageCost
from koopman_lab.robots.robot_type import RobotType
from koopman_lab.robots.table import robot_type


class PredictionModel(Protocol):
    """A discrete-time model with zero-order hold on the input (paper, section 2.1).

    States are relative to the goal, in the units of the robot's states.
    """

    @property
    def robot(self) -> RobotType:
        """Which robot it describes."""

    @property
    def dictionary(self) -> Dictionary | None:
        """Its observables; None if it knows of none."""

    @property
    def state_dim(self) -> int:
        """Number n of the robot's states."""

    @property
    def input_dim(self) -> int:
        """Number m of the robot's inputs."""

    @property
    def size(self) -> int:
        """Number S of what it propagates: n, or the number M of observables."""

    @property
    def speeds_at(self) -> tuple[int, ...]:
        """Where s holds v and omega; empty for robots whose state does not."""

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

    @property
    def disturbance_dim(self) -> int:
        """How many of the parameters, the last ones, may change between two problems."""

    def lift(self, x: Any) -> Any:
        """Return the s to begin with in a state: CasADi SX (n,) to (S,)."""

    def step(self, s: Any, u: Any, parameters: Any) -> Any:
        """Return s one sampling time later: CasADi SX (S,) and (m,) to (S,).

        The parameters are numbers (DM) or symbols (SX).
        """

    def state(self, s: Any) -> Any:
        """Return the state that s stands for: CasADi SX (S,) to (n,)."""

    def cost(self, cost: StageCost, s: Any, u: Any, weights: Any) -> Any:
        """Return what a stage costs in s: CasADi SX (S,), (m,) and weights to a scalar."""


class _OfARobot:
    """What all models share."""

    robot: RobotType
    disturbance_dim = 0

    @property
    def state_dim(self) -> int:
        """Return the number of states."""
        return self.robot.state_dim

    @property
    def input_dim(self) -> int:
        """Return the number of inputs."""
        return self.robot.input_dim


class _OfTheState(_OfARobot):
    """What all models share that propagate the state itself."""

    @property
    def size(self) -> int:
        """Return the number of states."""
        return self.state_dim

    @property
    def speeds_at(self) -> tuple[int, ...]:
        """Return the places of v and omega."""
        return self.robot.speeds_at

    def lift(self, x: Any) -> Any:
        """Return the state itself."""
        return x

    def state(self, s: Any) -> Any:
        """Return the state itself."""
        return s

    def cost(self, cost: StageCost, s: Any, u: Any, weights: Any) -> Any:
        """Return what a stage costs; see :class:`PredictionModel`."""
        return cost(s, u, weights)


class NominalPrediction(_OfTheState):
    """The nominal equations as a prediction model (paper, sections 3.1 and 3.2).

    Parameters
    ----------
    robot
        Which robot, by its name.
    dt_s
        Sampling time in s.
    marker_offset
        Pose of the tracked frame on the robot.
    """

    dictionary: Dictionary | None = None

    def __init__(self, robot: str, dt_s: float, marker_offset: Pose = ORIGIN) -> None:
        self.robot = robot_type(robot)
        self.dt_s = dt_s
        self.marker_offset = marker_offset
        self.parameters = np.array([dt_s])

    def step(self, s: Any, u: Any, parameters: Any) -> Any:
        """Return the state one sampling time later; see :class:`PredictionModel`."""
        states = [s[i] for i in range(self.state_dim)]
        inputs = [u[i] for i in range(self.input_dim)]
        return ca.vertcat(*self.robot.components(states, inputs, parameters[0], ca))


class KoopmanPrediction(_OfTheState):
    """A bilinear Koopman surrogate, reprojected in each step (paper, sections 2.2 and 5.4).

    Parameters
    ----------
    model
        Learned from data.
    """

    def __init__(self, model: BilinearModel) -> None:
        self.robot = model.robot
        self.dictionary: Dictionary | None = model.dictionary
        self.dt_s = model.dt_s
        self.marker_offset = model.marker_offset
        self.parameters = model.parameters
        self.model = model
        self._step = model.casadi_step()

    def step(self, s: Any, u: Any, parameters: Any) -> Any:
        """Return the state one sampling time later; see :class:`PredictionModel`."""
        return self._step(s, u, parameters)


class LiftedPrediction(_OfARobot):
    """A bilinear Koopman surrogate without reprojection (paper, section 4).

    The observables are propagated as they are. Where psi does not hold the angle, it is read off by
    the four-quadrant arctangent and lies in (-pi, pi].

    Parameters
    ----------
    model
        Learned from data.
    """

    def __init__(self, model: BilinearModel) -> None:
        self.robot = model.robot
        self.dictionary: Dictionary | None = model.dictionary
        self.size = model.dictionary.size
        rows = [model.dictionary.state_rows[place] for place in model.robot.speeds_at]
        self.speeds_at = tuple(row for row in rows if row is not None)
        self.dt_s = model.dt_s
        self.marker_offset = model.marker_offset
        self.parameters = model.parameters
        self._observables = model.dictionary
        self._step = model.casadi_lifted_step()

    def lift(self, x: Any) -> Any:
        """Return the observables; see :class:`PredictionModel`."""
        return ca.vertcat(*self._observables.observables(ca.vertsplit(x), ca))

    def step(self, s: Any, u: Any, parameters: Any) -> Any:
        """Return the observables one sampling time later; see :class:`PredictionModel`."""
        return self._step(s, u, parameters)

    def state(self, s: Any) -> Any:
        """Return the state read off the observables; see :class:`PredictionModel`."""
        return ca.vertcat(*self._observables.project_components(ca.vertsplit(s), None, ca))

    def cost(self, cost: StageCost, s: Any, u: Any, weights: Any) -> Any:
        """Return what a stage costs; see :class:`PredictionModel`."""
        if isinstance(cost, QuadraticInObservables) and cost.dictionary == self._observables:
            return cost.of_observables(s, u, weights)
        return cost(self.state(s), u, weights)


def prediction_of(
    model: BilinearModel, settings: Controller
) -> KoopmanPrediction | NominalPrediction:
    """Return what a controller predicts with: the model, or the nominal equations in its place."""
    if settings.predict == "nominal":
        return NominalPrediction(model.robot.name, settings.dt_s, model.marker_offset)
    return KoopmanPrediction(model)


def load_prediction(path: Path, settings: Controller) -> KoopmanPrediction | NominalPrediction:
    """Return what a controller predicts with, from a model file; see :func:`prediction_of`.

    Raises
    ------
    ModelError
        If the file is missing or damaged.
    """
    return prediction_of(BilinearModel.load(path), settings)

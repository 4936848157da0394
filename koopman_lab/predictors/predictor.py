"""What the controller and the evaluation ask of whatever predicts a robot.

A learned model lies in a file and is compared by the evaluation (:class:`LearnedModel`). A
controller plans with its prediction model (:class:`PredictionModel`), which propagates a vector s
by steps. That is the robot's state, or without reprojection the vector psi of observables, lifted
once at the start and never projected back, except where somebody wants to know the state.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from koopman_lab.errors import ModelError
from koopman_lab.geometry.planar import Pose
from koopman_lab.koopman.dictionary import Dictionary
from koopman_lab.robots.robot_type import RobotType

Array = NDArray[np.float64]
Propagated = Literal["state", "observables", "other"]


class LearnedModel(Protocol):
    """A model of a robot, learned from data.

    States are in the units of the robot's states, and all angles may be of any number of turns.
    """

    @property
    def predictor(self) -> str:
        """Name of the row in the table of predictors."""

    @property
    def name(self) -> str:
        """What to call it among others, such as the name of its dictionary."""

    @property
    def robot(self) -> RobotType:
        """Which robot it describes."""

    @property
    def dt_s(self) -> float:
        """Sampling time in s."""

    @property
    def marker_offset(self) -> Pose:
        """Pose of the tracked frame in the frame whose poses the states hold."""

    @property
    def metadata(self) -> Mapping[str, Any]:
        """Where it comes from; JSON."""

    @property
    def lifts(self) -> bool:
        """Whether it predicts observables, so that predictions without reprojection differ."""

    def predict(self, x0: Array, inputs: Array, *, reproject: bool = True) -> Array:
        """Return the states (..., H + 1, n) from x0 (..., n) under inputs (..., H, m)."""

    def save(self, path: Path) -> None:
        """Write it as one model file, whole or not at all."""


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
    def propagates(self) -> Propagated:
        """What s is: the state, the dictionary's observables, or something else."""

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
    def parameters(self) -> Array:
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

    def without_reprojection(self) -> PredictionModel:
        """Return what propagates observables as they are; itself where there are none."""


class RobotPrediction:
    """What prediction models share; they set ``robot``, and whatever differs."""

    robot: RobotType
    disturbance_dim = 0
    dictionary: Dictionary | None = None

    @property
    def state_dim(self) -> int:
        """Return the number of states."""
        return self.robot.state_dim

    @property
    def input_dim(self) -> int:
        """Return the number of inputs."""
        return self.robot.input_dim

    def without_reprojection(self) -> Any:
        """Return the model itself."""
        return self


class StatePrediction(RobotPrediction):
    """What prediction models share that propagate the state itself."""

    propagates: Propagated = "state"

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


def require_robot(model: LearnedModel, kind: str) -> None:
    """Refuse a model for another robot.

    Raises
    ------
    ModelError
        If the model is of another robot than ``kind``.
    """
    if model.robot.name != kind:
        model_kind = model.robot.name
        raise ModelError(
            f"the model ({model.name}) is of the {model_kind} robot, the lab is set up for the "
            f"{kind} one; train a model from a {kind} session, or say --robot {model_kind}"
        )

"""Stage costs (paper, section 3.3).

A stage cost is written once for NumPy and CasADi: it only indexes its arguments and multiplies
and adds what it finds. States and inputs come components first, so that whole trajectories of
shape (n, K) and (m, K) give K costs at once.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from koopman_lab.config.costs import COSTS, Cost, weighs_states
from koopman_lab.config.schema import Controller
from koopman_lab.errors import ConfigError
from koopman_lab.koopman.dictionary import Dictionary
from koopman_lab.predictors.predictor import PredictionModel
from koopman_lab.robots.robot_type import RobotType


class StageCost(Protocol):
    """The cost of one stage; zero at the goal, which is the origin, and positive elsewhere."""

    @property
    def parameters(self) -> NDArray[np.float64]:
        """The weights as one vector; costs of one class and robot differ in nothing else."""

    def __call__(self, x: Any, u: Any, parameters: Any = None) -> Any:
        """Return the cost of a state and an input.

        Parameters
        ----------
        x
            State relative to the goal, in the units of the robot's states: a NumPy array (n,) or
            (n, K), or a CasADi vector (n,).
        u
            Input, in the units of the robot's inputs: of the same kind, (m,) or (m, K).
        parameters
            Symbols instead of the cost's own weights, in the same order.
        """


@dataclass(frozen=True)
class MixedExponents:
    """The mixed-exponents cost ``me`` (paper, eq. costME).

    The exponents follow from the sub-Riemannian geometry: a direction that the robot cannot take at
    once, such as x2 for wheels, counts with its square, everything else with its fourth power.

    Parameters
    ----------
    q
        Weights of the states (n,).
    r
        Weights of the inputs (m,).
    sideways
        States that are reached only by combining motions, by index
        (:attr:`~koopman_lab.robots.robot_type.RobotType.sideways`).
    """

    q: Sequence[float]
    r: Sequence[float]
    sideways: Sequence[int]

    @property
    def parameters(self) -> NDArray[np.float64]:
        """Return q, then r."""
        return np.array([*self.q, *self.r], float)

    def __call__(self, x: Any, u: Any, parameters: Any = None) -> Any:
        """Return the cost; see :class:`StageCost`."""
        weights = self.parameters if parameters is None else parameters
        states = len(self.q)
        cost = 0.0
        for index in self.sideways:
            cost = cost + weights[index] * _square(x[index])
        for index in range(states):
            if index not in self.sideways:
                cost = cost + weights[index] * _fourth_power(x[index])
        for index in range(len(self.r)):
            cost = cost + weights[states + index] * _fourth_power(u[index])
        return cost


@dataclass(frozen=True)
class Quadratic:
    """The control-engineering cost ``ce``: quadratic in state and input (paper, eq. cost_quadr).

    Parameters
    ----------
    q
        Weights of the states (n,).
    r
        Weights of the inputs (m,).
    """

    q: Sequence[float]
    r: Sequence[float]

    @property
    def parameters(self) -> NDArray[np.float64]:
        """Return q, then r."""
        return np.array([*self.q, *self.r], float)

    def __call__(self, x: Any, u: Any, parameters: Any = None) -> Any:
        """Return the cost; see :class:`StageCost`."""
        weights = self.parameters if parameters is None else parameters
        states = len(self.q)
        cost = 0.0
        for index in range(states):
            cost = cost + weights[index] * _square(x[index])
        for index in range(len(self.r)):
            cost = cost + weights[states + index] * _square(u[index])
        return cost


@dataclass(frozen=True)
class QuadraticInObservables:
    """The data-scientific cost ``ds``: quadratic in psi - psi_d (paper, eq. costPsi_quadr).

    Parameters
    ----------
    dictionary
        The observables; psi_d is theirs at the goal, which is the origin.
    q
        A weight for each observable.
    r
        Weights of the inputs.
    """

    dictionary: Dictionary
    q: Sequence[float]
    r: Sequence[float]

    @property
    def parameters(self) -> NDArray[np.float64]:
        """Return q, then r."""
        return np.array([*self.q, *self.r], float)

    def __call__(self, x: Any, u: Any, parameters: Any = None) -> Any:
        """Return the cost of the state's observables; see :class:`StageCost`."""
        m = np if isinstance(x, (np.ndarray, Sequence)) else ca
        states = [x[index] for index in range(self.dictionary.state_dim)]
        return self.of_observables(self.dictionary.observables(states, m), u, parameters)

    def of_observables(self, psi: Any, u: Any, parameters: Any = None) -> Any:
        """Return the cost of observables (M,) and an input.

        Where they are propagated without reprojection, they are not those of any state.
        """
        goal = self.dictionary.lift(np.zeros(self.dictionary.state_dim)).tolist()
        off = [psi[index] - wanted for index, wanted in enumerate(goal)]
        return Quadratic(self.q, self.r)(off, u, parameters)


def mixed_exponents(
    q: Sequence[float], r: Sequence[float], robot: RobotType, observables: Dictionary | None
) -> StageCost:
    """Return the cost ``me`` of a robot."""
    del observables
    return MixedExponents(q, r, robot.sideways)


def quadratic(
    q: Sequence[float], r: Sequence[float], robot: RobotType, observables: Dictionary | None
) -> StageCost:
    """Return the cost ``ce`` of a robot."""
    del robot, observables
    return Quadratic(q, r)


def quadratic_in_observables(
    q: Sequence[float], r: Sequence[float], robot: RobotType, observables: Dictionary | None
) -> StageCost:
    """Return the cost ``ds`` of a robot with a dictionary."""
    del robot
    assert observables is not None  # as its row asks for
    return QuadraticInObservables(observables, q, r)


class StageWeights(NamedTuple):
    """Weights of a stage cost.

    Attributes
    ----------
    names
        Of what q weighs: states, or observables.
    q, r
        One for each of the names, and one for each input.
    """

    names: tuple[str, ...]
    q: Sequence[float]
    r: Sequence[float]


def stage_cost(
    settings: Controller, robot: RobotType, observables: Dictionary | None = None
) -> StageCost:
    """Return the stage cost a configuration asks for.

    Parameters
    ----------
    settings, robot, observables
        See :func:`stage_weights`.

    Raises
    ------
    ConfigError, PluginError
        See :func:`stage_weights`.
    """
    row = COSTS.get(settings.cost)
    weights = stage_weights(settings, robot, observables)
    build = COSTS.load(row.name, row.factory)
    cost: StageCost = build(weights.q, weights.r, robot, observables)
    return cost


def stage_weights(
    settings: Controller, robot: RobotType, observables: Dictionary | None = None
) -> StageWeights:
    """Return the weights of the cost that a configuration asks for.

    Parameters
    ----------
    settings
        Name and weights; where it has none, the cost itself may.
    robot
        Whose states and inputs are weighted.
    observables
        The dictionary, for a cost of observables.

    Raises
    ------
    ConfigError
        If there are no weights for it, or not as many as it weighs states or observables, and
        inputs.
    PluginError
        If it is another package's, and cannot be used.
    """
    row = COSTS.get(settings.cost)
    q, r = _given(row, settings, robot)
    names, owner, what, hint = robot.state_names, f"the {robot.name} robot", "states", ""
    if row.weighs == "observables":
        dictionary = _required(row, observables)
        names, owner, what = dictionary.names, f"the dictionary {dictionary.name}", "observables"
        q, hint = q if len(q) > 1 else tuple(q) * len(names), "one weight for all of them, or "
    for key, weights, of, count, each, more in (
        ("q", q, owner, what, names, hint),
        ("r", r, f"the {robot.name} robot", "inputs", robot.input_names, ""),
    ):
        if len(weights) != len(each):
            raise ConfigError(
                f"controller.weights.{row.name}.{key} has {len(weights)} weights, {of} has "
                f"{len(each)} {count}; give {more}one for each of {', '.join(each)}"
            )
    return StageWeights(names, q, r)


def _given(
    row: Cost, settings: Controller, robot: RobotType
) -> tuple[Sequence[float], Sequence[float]]:
    weights = settings.weights.get(row.name)
    if weights is not None:
        return weights.q, weights.r
    if row.weights is None:
        raise ConfigError(
            f"controller.weights lacks the cost {row.name!r}; add controller.weights.{row.name} "
            "with q and r"
        )
    return row.weights(robot)


def _required(row: Cost, observables: Dictionary | None) -> Dictionary:
    if observables is None:
        others = " or ".join(filter(weighs_states, COSTS.own_names()))
        raise ConfigError(
            f"controller.cost is {row.name}, which needs a dictionary; choose {others}"
        )
    return observables


def cost_of(model: PredictionModel, cost: StageCost, s: Any, u: Any, weights: Any) -> Any:
    """Return what a stage costs in what a model propagates.

    Parameters
    ----------
    model
        Says what s is.
    cost
        Of a state or, where the model propagates them, of observables.
    s, u, weights
        CasADi SX (S,), (m,) and as many as the cost's parameters.
    """
    if (
        model.propagates == "observables"
        and isinstance(cost, QuadraticInObservables)
        and cost.dictionary == model.dictionary
    ):
        return cost.of_observables(s, u, weights)
    return cost(model.state(s), u, weights)


def _square(value: Any) -> Any:
    return value * value


def _fourth_power(value: Any) -> Any:
    # Products, because a general power is slower and has no derivative at zero in CasADi.
    return _square(_square(value))

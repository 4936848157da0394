"""The stage costs of the predictive controller (paper, section 3.3).

A stage cost is written once for NumPy and CasADi: it only indexes its arguments and multiplies
and adds what it finds. States and inputs come components first, so that whole trajectories of
shape (n, K) and (m, K) give K costs at once.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import casadi as ca
import numpy as np
from numpy.typing import NDArray

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
        deviation = [psi[index] - value for index, value in enumerate(goal)]
        return Quadratic(self.q, self.r)(deviation, u, parameters)


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


def cost_of(model: PredictionModel, cost: StageCost, s: Any, u: Any, weights: Any) -> Any:
    """Return what a stage costs in what a model propagates.

    Parameters
    ----------
    model
        Says what s is.
    cost
        Cost of a state or, where the model propagates them, of observables.
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

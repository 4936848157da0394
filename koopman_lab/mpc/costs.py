"""Stage costs (paper, section 3.3).

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

from koopman_lab.config.schema import Controller
from koopman_lab.errors import ConfigError
from koopman_lab.koopman.dictionary import Dictionary
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


def stage_cost(
    settings: Controller, robot: RobotType, observables: Dictionary | None = None
) -> StageCost:
    """Return the stage cost a configuration asks for.

    Parameters
    ----------
    settings
        Name and weights.
    robot
        Whose states and inputs are weighted.
    observables
        The dictionary, for a cost of observables.

    Raises
    ------
    ConfigError
        If there are no weights for it, or not as many as the dictionary has observables.
    """
    weights = settings.weights.get(settings.cost)
    if weights is None:
        raise ConfigError(
            f"controller.weights lacks the cost {settings.cost!r}; "
            f"add controller.weights.{settings.cost} with q and r"
        )
    if settings.cost == "me":
        return MixedExponents(weights.q, weights.r, robot.sideways)
    if settings.cost == "ce":
        return Quadratic(weights.q, weights.r)
    if observables is None:
        raise ConfigError("controller.cost is ds, which needs a dictionary; choose me or ce")
    q = weights.q if len(weights.q) > 1 else weights.q * observables.size
    if len(q) != observables.size:
        raise ConfigError(
            f"controller.weights.ds.q has {len(q)} weights, the dictionary {observables.name} has "
            f"{observables.size} observables; give one weight for all of them, or one for each of "
            + ", ".join(observables.names)
        )
    return QuadraticInObservables(observables, q, weights.r)


def _square(value: Any) -> Any:
    return value * value


def _fourth_power(value: Any) -> Any:
    # Products, because a general power is slower and has no derivative at zero in CasADi.
    return _square(_square(value))

"""The optimal control problem of the paper (eq. OCP) as a nonlinear program.

The sum runs over H + 1 stages. The input of stage H acts on no state and enters only its own
stage cost, so its optimum is zero: it is left out, and the last stage costs l(x(H), 0). There are
no terminal ingredients. The goal is the origin; the controller transforms coordinates.

Direct multiple shooting, in the order that a stage-wise solver detects: s0, u0, s1, u1, ..., sH as
variables, and per stage the gap s(k+1) - F(s(k), u(k)) first, then what else binds that stage. s is
what the model propagates: the state, or without reprojection the observables.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from koopman_lab.mpc.stage_costs import StageCost, cost_of
from koopman_lab.predictors.predictor import PredictionModel

Array = NDArray[np.float64]

BRAKING = 0.5
"""Share of the largest deceleration with which a robot that is too fast must slow down at least."""


@dataclass(frozen=True)
class Bounds:
    """Bounds of the magnitudes of inputs and speeds.

    Attributes
    ----------
    u_max
        Largest magnitudes of the inputs, (m,).
    speed_max
        Largest magnitudes of v and omega, for robots whose state holds them; None for no bounds.
    speeds_at
        Where s holds v and omega.
    dt_s
        Sampling time in s.
    change_max
        How fast v and omega can change under the largest inputs, (2,).
    """

    u_max: Array
    speed_max: Sequence[float] | None = None
    speeds_at: Sequence[int] = ()
    dt_s: float = 0.0
    change_max: Array = field(default_factory=lambda: np.empty(0))

    def of_speeds(self, s0: Array, horizon: int) -> list[tuple[int, Array]]:
        """Return for v and omega its place in s and its bounds (H,) from stage 1 on.

        A robot that is faster already is given time to brake, or there would be no solution.
        """
        if self.speed_max is None:
            return []
        after_s = self.dt_s * np.arange(1, horizon + 1)
        return [
            (place, np.maximum(largest, abs(s0[place]) - BRAKING * change * after_s))
            for place, largest, change in zip(
                self.speeds_at, self.speed_max, self.change_max, strict=True
            )
        ]


def bounds_for(
    model: PredictionModel, u_max: Sequence[float], speed_max: Sequence[float] | None
) -> Bounds:
    """Return bounds of inputs, and of the speeds of a model whose robot has them in its state."""
    robot, largest = model.robot, np.asarray(u_max, float)
    # How much each input changes each speed within a second, from rest.
    rest, units = np.zeros(robot.state_dim), np.eye(robot.input_dim)
    changes = (robot.step(rest, units, 1.0) - rest)[:, list(robot.speeds_at)]
    change_max = largest @ np.abs(changes)
    return Bounds(largest, speed_max, model.speeds_at, model.dt_s, change_max)


@dataclass(frozen=True)
class OptimalControlProblem:
    """A nonlinear program and how to read its variables.

    Attributes
    ----------
    program
        For ``casadi.nlpsol``: x, p, f, g, or the path of a library that holds them. The parameters
        p are the s to begin with, the factor that the objective is multiplied by, and
        ``parameters``; all constraints g are equalities to zero.
    bounds
        Bounds of inputs and speeds.
    horizon, size
        H and the number S of what the model propagates.
    parameters
        Numbers that the program does not hold itself, (P,).
    disturbance_at
        Where among them those begin that may change between two problems.
    """

    program: dict[str, Any] | str
    bounds: Bounds
    horizon: int
    size: int
    parameters: Array = field(default_factory=lambda: np.empty(0))
    disturbance_at: int = 0

    def upper(self, s0: Array) -> Array:
        """Return the upper bounds of the variables; the lower ones are their negatives.

        Parameters
        ----------
        s0
            Where the problem begins, (S,).
        """
        states = np.full((self.horizon + 1, self.size), np.inf)
        # What is measured is not up to the optimiser, so the first stage has no bounds.
        for place, bound in self.bounds.of_speeds(s0, self.horizon):
            states[1:, place] = bound
        return self.pack(states, np.tile(self.bounds.u_max, (self.horizon, 1)))

    @property
    def constraints(self) -> int:
        """Return the number of rows of g."""
        return self.size * (self.horizon + 1)

    def pack(self, propagated: Array, inputs: Array) -> Array:
        """Return the variables for s (H + 1, S) and inputs (H, m)."""
        stages = np.hstack([propagated[:-1], inputs])
        return np.concatenate([stages.ravel(), propagated[-1]])

    def unpack(self, variables: Array) -> tuple[Array, Array]:
        """Return s (H + 1, S) and inputs (H, m) in the variables."""
        n = self.size
        stages = variables[:-n].reshape(self.horizon, n + self.bounds.u_max.size)
        return np.vstack([stages[:, :n], variables[-n:]]), stages[:, n:].copy()


def transcribe(
    model: PredictionModel, cost: StageCost, horizon: int, bounds: Bounds
) -> OptimalControlProblem:
    """Return the optimal control problem of a model, written out stage by stage.

    Parameters
    ----------
    model
        Predicts the robot.
    cost
        Cost of a stage.
    horizon
        H, at least 1.
    bounds
        Bounds of inputs and speeds.
    """
    size = model.size
    initial, factor = ca.SX.sym("initial", size), ca.SX.sym("factor")
    dim, weights = model.disturbance_dim, ca.DM(cost.parameters)
    fixed, disturbance = np.split(model.parameters, [model.parameters.size - dim])
    d = ca.SX.sym("d", dim)
    numbers = ca.vertcat(ca.DM(fixed), d)
    variables, gaps = [], []
    total: Any = 0.0
    s = ca.SX.sym("s_0", size)
    for k in range(horizon):
        u, following = ca.SX.sym(f"u_{k}", model.input_dim), ca.SX.sym(f"s_{k + 1}", size)
        variables += [s, u]
        gaps.append(following - model.step(s, u, numbers))
        if k == 0:
            gaps.append(s - initial)
        total = total + cost_of(model, cost, s, u, weights)
        s = following
    variables.append(s)
    total = total + cost_of(model, cost, s, ca.SX.zeros(model.input_dim), weights)
    program = {
        "x": ca.vertcat(*variables),
        "p": ca.vertcat(initial, factor, d),
        "f": factor * total,
        "g": ca.vertcat(*gaps),
    }
    return OptimalControlProblem(program, bounds, horizon, size, disturbance)

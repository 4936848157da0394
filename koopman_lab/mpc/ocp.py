"""The optimal control problem of the paper (eq. OCP) as a nonlinear program.

The sum runs over H + 1 stages. The input of stage H acts on no state and enters only its own
stage cost, so its optimum is zero: it is left out, and the last stage costs l(x(H), 0). There are
no terminal ingredients. The goal is the origin; the controller transforms coordinates.

Direct multiple shooting, in the order that a stage-wise solver detects: x0, u0, x1, u1, ..., xH as
variables, and per stage the gap x(k+1) - F(x(k), u(k)) first, then what else binds that stage.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from koopman_lab.mpc.costs import StageCost
from koopman_lab.mpc.prediction import PredictionModel


@dataclass(frozen=True)
class OptimalControlProblem:
    """A nonlinear program and how to read its variables.

    Attributes
    ----------
    program
        For ``casadi.nlpsol``: x, p, f, g. The parameters p are the initial state and the factor
        that the objective is multiplied by; all constraints g are equalities to zero.
    lower, upper
        Bounds of the variables.
    constraints
        Number of rows of g.
    horizon, state_dim
        H and n.
    """

    program: dict[str, Any]
    lower: NDArray[np.float64]
    upper: NDArray[np.float64]
    constraints: int
    horizon: int
    state_dim: int

    def pack(self, states: NDArray[np.float64], inputs: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the variables for states (H + 1, n) and inputs (H, 2)."""
        stages = np.hstack([states[:-1], inputs])
        return np.concatenate([stages.ravel(), states[-1]])

    def unpack(
        self, variables: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the states (H + 1, n) and inputs (H, 2) in the variables."""
        n = self.state_dim
        stages = variables[:-n].reshape(self.horizon, n + 2)
        return np.vstack([stages[:, :n], variables[-n:]]), stages[:, n:].copy()


def transcribe(
    model: PredictionModel, cost: StageCost, horizon: int, u_max: Sequence[float]
) -> OptimalControlProblem:
    """Return the optimal control problem of a model.

    Parameters
    ----------
    model
        Predicts the robot.
    cost
        Of a stage.
    horizon
        H, at least 1.
    u_max
        Largest magnitude of either input.
    """
    n = model.state_dim
    initial, factor = ca.SX.sym("initial", n), ca.SX.sym("factor")
    no_bound, bound = np.full(n, np.inf), np.asarray(u_max, dtype=float)
    variables, gaps, upper = [], [], []
    total: Any = 0.0
    x = ca.SX.sym("x_0", n)
    for k in range(horizon):
        u, following = ca.SX.sym(f"u_{k}", 2), ca.SX.sym(f"x_{k + 1}", n)
        variables += [x, u]
        upper += [no_bound, bound]
        gaps.append(following - model.step(x, u))
        if k == 0:
            gaps.append(x - initial)
        total = total + cost(x, u)
        x = following
    variables.append(x)
    upper.append(no_bound)
    total = total + cost(x, ca.SX.zeros(2))
    program = {
        "x": ca.vertcat(*variables),
        "p": ca.vertcat(initial, factor),
        "f": factor * total,
        "g": ca.vertcat(*gaps),
    }
    high = np.concatenate(upper)
    return OptimalControlProblem(program, -high, high, n * (horizon + 1), horizon, n)

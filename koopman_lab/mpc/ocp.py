"""The optimal control problem of the paper (eq. OCP) as a nonlinear program.

The sum runs over H + 1 stages. The input of stage H acts on no state and enters only its own
stage cost, so its optimum is zero: it is left out, and the last stage costs l(x(H), 0). There are
no terminal ingredients. The goal is the origin; the controller transforms coordinates.

Direct multiple shooting, in the order that a stage-wise solver detects: x0, u0, x1, u1, ..., xH as
variables, and per stage the gap x(k+1) - F(x(k), u(k)) first, then what else binds that stage.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
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
        For ``casadi.nlpsol``: x, p, f, g, or the path of a library that holds them. The parameters
        p are the initial state, the factor that the objective is multiplied by, and
        ``parameters``; all constraints g are equalities to zero.
    u_max
        Largest magnitude of either input, (2,).
    horizon, state_dim
        H and n.
    parameters
        Numbers that the program does not hold itself, (P,).
    """

    program: dict[str, Any] | str
    u_max: NDArray[np.float64]
    horizon: int
    state_dim: int
    parameters: NDArray[np.float64] = field(default_factory=lambda: np.empty(0))

    @property
    def upper(self) -> NDArray[np.float64]:
        """Return the upper bounds of the variables; the lower ones are their negatives."""
        no_bound = np.full(self.state_dim, np.inf)
        stages = np.tile(np.concatenate([no_bound, self.u_max]), self.horizon)
        return np.concatenate([stages, no_bound])

    @property
    def constraints(self) -> int:
        """Return the number of rows of g."""
        return self.state_dim * (self.horizon + 1)

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
    """Return the optimal control problem of a model, written out stage by stage.

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
    numbers = ca.DM(model.parameters)
    variables, gaps = [], []
    total: Any = 0.0
    x = ca.SX.sym("x_0", n)
    for k in range(horizon):
        u, following = ca.SX.sym(f"u_{k}", 2), ca.SX.sym(f"x_{k + 1}", n)
        variables += [x, u]
        gaps.append(following - model.step(x, u, numbers))
        if k == 0:
            gaps.append(x - initial)
        total = total + cost(x, u)
        x = following
    variables.append(x)
    total = total + cost(x, ca.SX.zeros(2))
    program = {
        "x": ca.vertcat(*variables),
        "p": ca.vertcat(initial, factor),
        "f": factor * total,
        "g": ca.vertcat(*gaps),
    }
    return OptimalControlProblem(program, np.asarray(u_max, float), horizon, n)

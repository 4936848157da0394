"""The optimal control problem as C code that walks through the stages in loops.

Every stage has the same functions, so only those are differentiated: the derivatives of the whole
program are their results, placed by where the stage stands. What is generated holds no number of
model or cost; these are parameters, and one library serves all models of a dictionary.
"""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from koopman_lab.mpc import rollout
from koopman_lab.mpc.stage_costs import StageCost, cost_of
from koopman_lab.predictors.predictor import PredictionModel

Indices = NDArray[np.int_]


def parameters_of(model: PredictionModel, cost: StageCost) -> NDArray[np.float64]:
    """Return the numbers of model and cost in the order of :func:`source`, (P,)."""
    return np.concatenate([model.parameters, cost.parameters])


def source(model: PredictionModel, cost: StageCost, horizon: int) -> str:
    """Return C code for ``casadi.nlpsol`` of the program that :func:`ocp.transcribe` writes out.

    Variables, constraints and their order are those of :func:`ocp.transcribe`. The parameters are
    the s to begin with, the factor of the objective, and :func:`parameters_of` model and cost. The
    code of :func:`rollout.function` is there as well.

    Parameters
    ----------
    model, cost
        Only their shapes count.
    horizon
        H, at least 1.
    """
    program = _Program(_Stage(model, cost), horizon)
    generator = ca.CodeGenerator("program.c", {"with_header": False})
    for function in program.functions():
        generator.add(function)
    generator.add(rollout.function(model, cost, horizon))
    return str(generator.dump())


class _Stage:
    """Functions of one stage and their derivatives; matrices come as their nonzeros."""

    def __init__(self, model: PredictionModel, cost: StageCost) -> None:
        n, m = self.size, self.inputs = model.size, model.input_dim
        x, u = ca.SX.sym("x", n), ca.SX.sym("u", m)
        z, rest = ca.vertcat(x, u), ca.SX.zeros(m)
        of_model = ca.SX.sym("model", model.parameters.size)
        weights = ca.SX.sym("weights", cost.parameters.size)
        p = ca.vertcat(of_model, weights)
        self.parameters = p.numel()
        factor, multipliers = ca.SX.sym("factor"), ca.SX.sym("multipliers", n)
        following = model.step(x, u, of_model)
        stage_cost, end_cost = (
            cost_of(model, cost, x, u, weights),
            cost_of(model, cost, x, rest, weights),
        )
        jacobian = ca.jacobian(following, z)
        hessian, _ = ca.hessian(factor * stage_cost - ca.dot(multipliers, following), z)
        end_hessian, _ = ca.hessian(end_cost, x)
        self.jacobian_at = _places(jacobian)
        self.hessian_at = _places(hessian)
        self.end_hessian_at = _places(end_hessian)
        self.step = ca.Function("step", [x, u, p], [following])
        self.cost = ca.Function("cost", [x, u, p], [stage_cost])
        self.gradient = ca.Function("gradient", [x, u, p], [ca.gradient(stage_cost, z)])
        self.jacobian = ca.Function("jacobian", [x, u, p], [following, _nonzeros(jacobian)])
        self.hessian = ca.Function("hessian", [x, u, p, factor, multipliers], [_nonzeros(hessian)])
        self.end_cost = ca.Function("end_cost", [x, p], [end_cost])
        self.end_gradient = ca.Function("end_gradient", [x, p], [ca.gradient(end_cost, x)])
        self.end_hessian = ca.Function("end_hessian", [x, p], [_nonzeros(end_hessian)])


class _Program:
    """The functions that ``casadi.nlpsol`` looks for in a library, by its names and arguments."""

    def __init__(self, stage: _Stage, horizon: int) -> None:
        n, width = stage.size, stage.size + stage.inputs
        self._stage, self._horizon, self._n, self._width = stage, horizon, n, width
        self._size, self._rows = width * horizon + n, n * (horizon + 1)
        self._x = ca.MX.sym("x", self._size)
        self._p = ca.MX.sym("p", n + 1 + stage.parameters)
        self._lam_f, self._lam_g = ca.MX.sym("lam_f"), ca.MX.sym("lam_g", self._rows)
        stages = ca.reshape(self._x[: width * horizon], width, horizon)
        self._states, self._inputs = stages[:n, :], stages[n:, :]
        self._last = self._x[width * horizon :]
        self._initial, self._factor = self._p[:n], self._p[n]
        self._numbers = self._p[n + 1 :]

    def functions(self) -> list[Any]:
        """Return all of them, as CasADi functions."""
        x, p, lam_f, lam_g = self._x, self._p, self._lam_f, self._lam_g
        following, jacobian = self._map_stages(self._stage.jacobian)
        g, dg = self._gaps(following), self._jacobian(jacobian)
        objective, gradient = self._objective(), self._gradient()
        gaps_alone = self._gaps(self._map_stages(self._stage.step))
        d_lagrangian = lam_f * gradient + ca.mtimes(dg.T, lam_g)
        # nlpsol wants this one to exist but has no use for it; nobody asks for d/dp.
        no_answer = np.full(p.numel(), np.nan)
        at, multipliers = ["x", "p"], ["lam_f", "lam_g"]
        return [
            ca.Function("nlp", [x, p], [objective, gaps_alone], at, ["f", "g"]),
            ca.Function("nlp_f", [x, p], [objective], at, ["f"]),
            ca.Function("nlp_g", [x, p], [gaps_alone], at, ["g"]),
            ca.Function("nlp_grad_f", [x, p], [gradient], at, ["grad_f_x"]),
            ca.Function("nlp_jac_g", [x, p], [g, dg], at, ["g", "jac_g_x"]),
            ca.Function(
                "nlp_hess_l",
                [x, p, lam_f, lam_g],
                [d_lagrangian, self._hessian()],
                at + multipliers,
                ["grad_gamma_x", "hess_gamma_x_x"],
            ),
            ca.Function(
                "nlp_grad",
                [x, p, lam_f, lam_g],
                [objective, g, d_lagrangian, no_answer],
                at + multipliers,
                ["f", "g", "grad_gamma_x", "grad_gamma_p"],
            ),
        ]

    def _map_stages(self, function: Any, *more: Any) -> Any:
        """Call a stage's function in every stage; the parameters are the same in all of them.

        ``more`` are a scalar that is the same and a matrix with a column for each stage.
        """
        shared = [2, 3] if more else [2]
        loop = function.map(f"each_{function.name()}", "serial", self._horizon, shared, [])
        return loop(self._states, self._inputs, self._numbers, *more)

    def _objective(self) -> Any:
        costs = self._map_stages(self._stage.cost)
        return self._factor * (ca.sum2(costs) + self._stage.end_cost(self._last, self._numbers))

    def _gradient(self) -> Any:
        inside = self._map_stages(self._stage.gradient)
        end = self._stage.end_gradient(self._last, self._numbers)
        return self._factor * ca.vertcat(ca.vec(inside), end)

    def _gaps(self, following: Any) -> Any:
        gaps = ca.horzcat(self._states[:, 1:], self._last) - following
        return ca.vertcat(gaps[:, 0], self._states[:, 0] - self._initial, ca.vec(gaps[:, 1:]))

    def _jacobian(self, nonzeros: Any) -> Any:
        """Return dg/dx from the nonzeros of each stage's, a column for each stage."""
        n, horizon = self._n, self._horizon
        (rows, columns), first = self._stage.jacobian_at, self._first_variables()
        # The initial condition stands between the first and the second gap.
        gaps = np.array([0, *range(2 * n, self._rows, n)], int)[:horizon]
        ahead = np.arange(n)
        at_rows = [np.add.outer(gaps, rows), np.add.outer(gaps, ahead), n + ahead]
        at_columns = [np.add.outer(first[:-1], columns), np.add.outer(first[1:], ahead), ahead]
        minus = nonzeros.numel()
        ones_at = np.full(n * (horizon + 1), minus)
        values = ca.vertcat(-ca.vec(nonzeros), 1.0)
        return _scattered((self._rows, self._size), at_rows, at_columns, values, ones_at)

    def _hessian(self) -> Any:
        """Return the second derivative of lam_f f + lam_g' g by x."""
        n, lam_g = self._n, self._lam_g
        factor = self._lam_f * self._factor
        of_gaps = ca.reshape(ca.vertcat(lam_g[:n], lam_g[2 * n :]), n, self._horizon)
        inside = self._map_stages(self._stage.hessian, factor, of_gaps)
        end = factor * self._stage.end_hessian(self._last, self._numbers)
        (rows, columns), (end_rows, end_columns) = (
            self._stage.hessian_at,
            self._stage.end_hessian_at,
        )
        first = self._first_variables()
        at_rows = [np.add.outer(first[:-1], rows), first[-1] + end_rows]
        at_columns = [np.add.outer(first[:-1], columns), first[-1] + end_columns]
        values = ca.vertcat(ca.vec(inside), end)
        return _scattered((self._size, self._size), at_rows, at_columns, values)

    def _first_variables(self) -> Indices:
        """Return where each stage's variables begin, (H + 1,)."""
        return np.arange(self._horizon + 1) * self._width


def _places(matrix: Any) -> tuple[Indices, Indices]:
    """Return rows and columns of the nonzeros, in their order."""
    rows, columns = matrix.sparsity().get_triplet()
    return np.array(rows, int), np.array(columns, int)


def _nonzeros(matrix: Any) -> Any:
    return ca.vertcat(*matrix.nonzeros())


def _scattered(
    shape: tuple[int, int],
    rows: list[Indices],
    columns: list[Indices],
    values: Any,
    repeated: Indices | None = None,
) -> Any:
    """Return the sparse matrix with the given values at the given places.

    Place number i takes value number i; ``repeated`` says which values the places beyond take.
    """
    row = np.concatenate([part.ravel() for part in rows])
    column = np.concatenate([part.ravel() for part in columns])
    extra = np.array([], int) if repeated is None else repeated
    value_indices = np.concatenate([np.arange(row.size - extra.size), extra])
    order = np.lexsort((row, column))
    pattern = ca.Sparsity.triplet(*shape, row[order].tolist(), column[order].tolist())
    return ca.MX(pattern, values[value_indices[order].tolist()])

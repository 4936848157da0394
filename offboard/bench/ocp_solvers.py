"""One optimal control problem put to several solvers, so that each can be timed."""

from __future__ import annotations

import importlib.util
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from koopman_lab.config.controller import BackEnd
from koopman_lab.config.schema import LabConfig
from koopman_lab.mpc.rollout import Rollout
from koopman_lab.mpc.solver import Solver, make_solver
from koopman_lab.mpc.stage_costs import StageCost, cost_of
from koopman_lab.predictors.predictor import PredictionModel

Array = NDArray[np.float64]

DO_MPC = "do_mpc"
IPOPT_ITERATIONS = 3000
"""IPOPT's own default."""


@dataclass(frozen=True)
class Task:
    """One problem of the sequence."""

    x0: Array
    guess: Array


class Candidate(Protocol):
    """A solver under the clock; only ``run`` is timed."""

    def prepare(self, task: Task) -> None:
        """Take the problem."""

    def run(self) -> None:
        """Solve it."""

    def answer(self) -> tuple[Array, int]:
        """Return the inputs (H, 2) of the plan, and the number of iterations."""


Maker = Callable[[LabConfig, PredictionModel, StageCost], Candidate]


def has_do_mpc() -> bool:
    """Return whether do-mpc is installed."""
    return importlib.util.find_spec(DO_MPC) is not None


def makers() -> dict[str, Maker]:
    """Return what makes each solver that there is, by its name in the rows."""
    table: dict[str, Maker] = {"ours": _ours, "ipopt": _ipopt}
    return table | ({"do-mpc": _DoMpc} if has_do_mpc() else {})


def lab_solver(
    lab: LabConfig,
    prediction: PredictionModel,
    cost: StageCost,
    back_end: BackEnd | None = None,
    most_iterations: int | None = None,
    *,
    scaled: bool = True,
) -> Solver:
    """Return a solver behind our interface; see :func:`~koopman_lab.mpc.solver.make_solver`."""
    settings = lab.controller
    return make_solver(
        prediction,
        cost,
        settings.horizon,
        settings.u_max,
        back_end or settings.solver,
        most_iterations,
        use_compiler=settings.use_compiler,
        scaled=scaled,
    )


class _LabCandidate:
    """A solver behind the interface of this package."""

    def __init__(self, solver: Solver) -> None:
        self._solver = solver

    def prepare(self, task: Task) -> None:
        self._task = task

    def run(self) -> None:
        self._plan = self._solver.solve(self._task.x0, self._task.guess)

    def answer(self) -> tuple[Array, int]:
        return self._plan.inputs, self._plan.iterations


def _ours(lab: LabConfig, prediction: PredictionModel, cost: StageCost) -> Candidate:
    return _LabCandidate(lab_solver(lab, prediction, cost))


def _ipopt(lab: LabConfig, prediction: PredictionModel, cost: StageCost) -> Candidate:
    """Return the paper's solver: unrolled, default options, the objective as it is."""
    return _LabCandidate(lab_solver(lab, prediction, cost, "ipopt", IPOPT_ITERATIONS, scaled=False))


class _DoMpc:
    """do-mpc as its documentation shows it; the guess is written into its vector of variables."""

    def __init__(self, lab: LabConfig, prediction: PredictionModel, cost: StageCost) -> None:
        with warnings.catch_warnings():
            # do-mpc warns of optional parts that are not installed, CasADi of do-mpc's calls.
            warnings.simplefilter("ignore")
            self._mpc = self._build(lab, prediction, cost)
        self._horizon = lab.controller.horizon
        self._rollout = Rollout(prediction, cost, self._horizon)

    @staticmethod
    def _build(lab: LabConfig, prediction: PredictionModel, cost: StageCost) -> Any:
        import casadi as ca
        import do_mpc

        settings, rest = lab.controller, ca.SX.zeros(2)
        numbers, weights = ca.DM(prediction.parameters), ca.DM(cost.parameters)
        model = do_mpc.model.Model("discrete", "SX")
        s = model.set_variable("_x", "s", shape=(prediction.size, 1))
        u = model.set_variable("_u", "u", shape=(2, 1))
        model.set_rhs("s", prediction.step(s, u, numbers))
        model.setup()
        s, u = model.x["s"], model.u["u"]
        mpc = do_mpc.controller.MPC(model)
        mpc.settings.n_horizon = settings.horizon
        mpc.settings.t_step = settings.dt_s
        mpc.settings.store_full_solution = False
        mpc.settings.supress_ipopt_output()
        stage, end = (cost_of(prediction, cost, s, v, weights) for v in (u, rest))
        mpc.set_objective(lterm=stage, mterm=end)
        mpc.set_rterm(u=0.0)
        mpc.bounds["lower", "_u", "u"] = -np.array(settings.u_max)
        mpc.bounds["upper", "_u", "u"] = np.array(settings.u_max)
        mpc.setup()
        mpc.set_initial_guess()
        return mpc

    def prepare(self, task: Task) -> None:
        propagated = self._rollout.trajectory(task.x0, task.guess).propagated
        variables = self._mpc.opt_x_num
        for k, s in enumerate(propagated):
            variables["_x", k, 0, -1] = s
        for k, u in enumerate(task.guess):
            variables["_u", k, 0] = u
        self._s0 = propagated[0].reshape(-1, 1)

    def run(self) -> None:
        self._mpc.make_step(self._s0)

    def answer(self) -> tuple[Array, int]:
        variables = self._mpc.opt_x_num
        inputs = [np.asarray(variables["_u", k, 0]).ravel() for k in range(self._horizon)]
        return np.array(inputs), int(self._mpc.solver_stats["iter_count"])

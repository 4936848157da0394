"""Solvers of the optimal control problem behind one small interface."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal, Protocol

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from koopman_lab.errors import ConfigError
from koopman_lab.mpc import compiled, stagewise
from koopman_lab.mpc.costs import StageCost
from koopman_lab.mpc.ocp import OptimalControlProblem, transcribe
from koopman_lab.mpc.prediction import PredictionModel, Rollout

BackEnd = Literal["fatrop", "ipopt"]

MOST_ITERATIONS: dict[BackEnd, int] = {"fatrop": 25, "ipopt": 200}
"""A bound on the effort that, unlike a time limit, leaves results the same on every machine.

From a shifted plan fatrop is within 1e-5 of the optimal value after 15 iterations, also where noise
moves the state by more than the cost that is left, and may then want 50 more for the last digits.
"""

SMALLEST_VALUE = 1e-12
"""The objective is divided by the guess's value, but by no less than this."""


@dataclass(frozen=True)
class Plan:
    """Inputs, and what the model predicts they do.

    Attributes
    ----------
    inputs
        (H, 2), inside the bounds.
    states
        (H + 1, n), simulated with the model under the inputs.
    value
        Sum of the stage costs along the states.
    iterations
        Of the solver; 0 for a plan that no solver made.
    ok
        Whether all numbers are finite, and the solver converged or at least improved the guess.
    status
        What the solver said.
    """

    inputs: NDArray[np.float64]
    states: NDArray[np.float64]
    value: float
    iterations: int
    ok: bool
    status: str


class Solver(Protocol):
    """Solves the optimal control problem from an initial guess."""

    description: str
    """What solves, in words for a person."""

    def solve(self, x0: NDArray[np.float64], guess: NDArray[np.float64]) -> Plan:
        """Return a plan for the state ``x0`` (n,), starting from the inputs ``guess`` (H, 2)."""


class NlpSolver:
    """A solver of CasADi; one instance serves one thread.

    The objective is scaled by the value of the guess. Close to the goal the costs are of the order
    of 1e-8, where absolute tolerances mean nothing.

    Parameters
    ----------
    problem
        What is solved.
    rollout
        Of the same model, cost and horizon.
    back_end
        ``fatrop`` uses the structure of the stages; ``ipopt`` is the paper's solver, for reference.

    most_iterations
        Of the solver, per call; None for :data:`MOST_ITERATIONS`. What it has found by then counts
        if it is better than the guess.
    form
        In what form the problem is evaluated, in words for a person.

    Raises
    ------
    ConfigError
        If this CasADi does not have the back end.
    """

    def __init__(
        self,
        problem: OptimalControlProblem,
        rollout: Rollout,
        back_end: BackEnd = "fatrop",
        most_iterations: int | None = None,
        form: str = "not compiled",
    ) -> None:
        self.description = f"{back_end}, {form}"
        self._problem = problem
        self._rollout = rollout
        self._back_end = back_end
        if not ca.has_nlpsol(back_end):
            raise ConfigError(
                f"solver {back_end}: CasADi does not load it; "
                "install the casadi wheel from PyPI again"
            )
        options = _options(back_end, problem, most_iterations or MOST_ITERATIONS[back_end])
        self._solver = ca.nlpsol("solver", back_end, problem.program, options)
        self._upper = problem.upper

    def solve(self, x0: NDArray[np.float64], guess: NDArray[np.float64]) -> Plan:
        """Return a plan for the state ``x0`` (n,), starting from the inputs ``guess`` (H, 2)."""
        states, guess_value = self._rollout(x0, guess)
        if not np.isfinite(guess_value):
            return Plan(guess, states, guess_value, 0, False, "the initial guess is not finite")
        factor = 1.0 / max(guess_value, SMALLEST_VALUE)
        result = self._solver(
            x0=self._problem.pack(states, guess),
            p=np.concatenate([x0, [factor], self._problem.parameters]),
            lbx=-self._upper,
            ubx=self._upper,
            lbg=0.0,
            ubg=0.0,
        )
        statistics = self._solver.stats()
        _, inputs = self._problem.unpack(np.asarray(result["x"]).ravel())
        # Interior-point methods may end a hair outside the bounds.
        u_max = self._problem.u_max
        inputs = np.clip(inputs, -u_max, u_max)
        states, value = self._rollout(x0, inputs)
        return Plan(
            inputs,
            states,
            value,
            int(statistics["iter_count"]),
            bool(np.isfinite(value)) and (bool(statistics["success"]) or value < guess_value),
            f"{self._back_end}: {statistics['return_status']}",
        )


def make_solver(
    model: PredictionModel,
    cost: StageCost,
    horizon: int,
    u_max: Sequence[float],
    back_end: BackEnd = "fatrop",
    most_iterations: int | None = None,
    *,
    use_compiler: bool = True,
) -> NlpSolver:
    """Return a solver of the optimal control problem; see :func:`ocp.transcribe`.

    fatrop evaluates compiled loops over the stages where they can be had, and otherwise the problem
    written out stage by stage, because loops that are not compiled are slower still. Both agree up
    to rounding. IPOPT always has the written-out form, as in the paper.
    """
    rollout, form = Rollout(model, cost, horizon), "not compiled"
    if back_end == "fatrop" and use_compiler:
        try:
            library = compiled.library(stagewise.source(model, cost, horizon))
        except compiled.NotCompiledError as reason:
            form = f"not compiled: {reason}"
        else:
            numbers = stagewise.parameters_of(model, cost)
            bounds = np.asarray(u_max, float)
            problem = OptimalControlProblem(str(library), bounds, horizon, model.state_dim, numbers)
            return NlpSolver(problem, rollout, back_end, most_iterations, "compiled")
    problem = transcribe(model, cost, horizon, u_max)
    return NlpSolver(problem, rollout, back_end, most_iterations, form)


def _options(
    back_end: BackEnd, problem: OptimalControlProblem, most_iterations: int
) -> dict[str, Any]:
    common = {
        "print_time": False,
        "error_on_fail": False,
        "show_eval_warnings": False,
        "calc_lam_p": False,  # nobody reads these multipliers
    }
    if back_end == "ipopt":
        return {
            **common,
            "ipopt.print_level": 0,
            "ipopt.sb": "yes",
            "ipopt.max_iter": most_iterations,
        }
    return {
        **common,
        "structure_detection": "auto",
        "equality": [True] * problem.constraints,
        "fatrop.print_level": 0,
        "fatrop.max_iter": most_iterations,
    }

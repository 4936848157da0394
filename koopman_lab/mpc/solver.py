"""Solvers of the optimal control problem behind one small interface."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from koopman_lab.config.controller import BackEnd
from koopman_lab.errors import ConfigError
from koopman_lab.mpc import compiled, ddp, stagewise
from koopman_lab.mpc.ocp import OptimalControlProblem, bounds_for, transcribe
from koopman_lab.mpc.rollout import Call, Rollout, disturbance_slice
from koopman_lab.mpc.stage_costs import StageCost
from koopman_lab.predictors.predictor import PredictionModel

MOST_ITERATIONS: dict[BackEnd, int] = {"ddp": 50, "fatrop": 25, "ipopt": 200}
"""A bound on the effort that, unlike a time limit, leaves results the same on every machine.

From a shifted plan ddp converges in 5 to 16 iterations, from a first guess it may take more. fatrop
is within 1e-5 of the optimal value after 15, also where noise moves the state by more than the cost
that is left, and may then want 50 more for the last digits.
"""

SMALLEST_VALUE = 1e-12
"""The objective is divided by the guess's value, but by no less than this."""


Array = NDArray[np.float64]

NOT_FINITE = "the initial guess is not finite"


@dataclass(frozen=True)
class Plan:
    """Inputs, and what the model predicts they do.

    Attributes
    ----------
    inputs
        (H, m), inside the bounds.
    states
        (H + 1, n), simulated with the model under the inputs.
    value
        Sum of the stage costs along the states.
    iterations
        Iterations of the solver; 0 for a plan that no solver made.
    ok
        Whether all numbers are finite, and the solver converged or at least improved the guess.
    status
        What the solver said.
    """

    inputs: Array
    states: Array
    value: float
    iterations: int
    ok: bool
    status: str


class Solver(Protocol):
    """Solves the optimal control problem from an initial guess."""

    description: str
    """What solves, in words for a person."""

    @property
    def rollout(self) -> Rollout:
        """What tells the value of plans, for the same model, cost and horizon."""

    def solve(self, x0: Array, guess: Array) -> Plan:
        """Return a plan for the state ``x0`` (n,), starting from the inputs ``guess`` (H, m)."""

    def disturb(self, d: Array) -> None:
        """Plan from now on with other last parameters of the model (its ``disturbance_dim``,)."""


class DdpSolver:
    """Differential dynamic programming behind the interface of :class:`Solver`.

    Parameters
    ----------
    improver
        The compiled solver.
    rollout
        Simulates the same model under the same cost and horizon.
    """

    description = "ddp, compiled"

    def __init__(self, improver: ddp.Improver, rollout: Rollout) -> None:
        self.rollout = rollout
        self._improver = improver

    def disturb(self, d: Array) -> None:
        """Plan with other last parameters of the model; see :class:`Solver`."""
        self.rollout.disturb(d)
        self._improver.disturb(d)

    def solve(self, x0: Array, guess: Array) -> Plan:
        """Return a plan for the state ``x0`` (n,), starting from the inputs ``guess`` (H, m)."""
        initial = self.rollout.trajectory(x0, guess)
        if not np.isfinite(initial.value):
            return Plan(guess, initial.states, initial.value, 0, False, NOT_FINITE)
        inputs, count = self._improver(initial.propagated[0], guess)
        improved = self.rollout.trajectory(x0, inputs)
        ok = bool(np.isfinite(improved.value)) and (count >= 0 or improved.value < initial.value)
        status = "ddp: " + ("converged" if count >= 0 else "not converged")
        return Plan(inputs, improved.states, improved.value, abs(count), ok, status)


class NlpSolver:
    """A solver of CasADi; one instance serves one thread.

    The objective is scaled by the value of the guess. Close to the goal the costs are of the order
    of 1e-8, where absolute tolerances mean nothing.

    Parameters
    ----------
    problem
        The optimal control problem.
    rollout
        Simulates the same model under the same cost and horizon.
    back_end
        ``fatrop`` uses the structure of the stages; ``ipopt`` is the paper's solver, for reference.
    most_iterations
        Largest number of iterations of a call; None for :data:`MOST_ITERATIONS`. What is found by
        then counts if it is better than the guess.
    form
        In what form the problem is evaluated, in words for a person.
    scaled
        Whether the objective is scaled.

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
        *,
        scaled: bool = True,
    ) -> None:
        self.description = f"{back_end}, {form}"
        self._problem = problem
        self._rollout = rollout
        self._scaled = scaled
        self._back_end = back_end
        if not ca.has_nlpsol(back_end):
            raise ConfigError(
                f"solver {back_end}: CasADi does not load it; "
                "install the casadi wheel from PyPI again"
            )
        options = _options(back_end, problem, most_iterations or MOST_ITERATIONS[back_end])
        self._call = Call(ca.nlpsol("solver", back_end, problem.program, options))

    @property
    def rollout(self) -> Rollout:
        """Return what tells the value of plans."""
        return self._rollout

    def disturb(self, d: Array) -> None:
        """Plan with other last parameters of the model; see :class:`Solver`."""
        self._rollout.disturb(d)
        at = self._problem.disturbance_at
        self._problem.parameters[at : at + d.size] = d

    def solve(self, x0: Array, guess: Array) -> Plan:
        """Return a plan for the state ``x0`` (n,), starting from the inputs ``guess`` (H, m)."""
        initial = self._rollout.trajectory(x0, guess)
        if not np.isfinite(initial.value):
            return Plan(guess, initial.states, initial.value, 0, False, NOT_FINITE)
        upper = self._problem.upper(initial.propagated[0])
        factor = 1.0 / max(initial.value, SMALLEST_VALUE) if self._scaled else 1.0
        # In CasADi's order; the last four, gaps and multipliers, stay zero.
        variables, parameters, lbx, ubx, *_ = self._call.arguments
        variables[:] = self._problem.pack(initial.propagated, guess)
        parameters[:] = np.concatenate([initial.propagated[0], [factor], self._problem.parameters])
        lbx[:], ubx[:] = -upper, upper
        self._call.run()
        statistics = self._call.statistics()
        _, inputs = self._problem.unpack(self._call.results[0])
        # Interior-point methods may end a hair outside the bounds.
        u_max = self._problem.bounds.u_max
        inputs = np.clip(inputs, -u_max, u_max)
        improved = self._rollout.trajectory(x0, inputs)
        return Plan(
            inputs,
            improved.states,
            improved.value,
            int(statistics["iter_count"]),
            bool(np.isfinite(improved.value))
            and (bool(statistics["success"]) or improved.value < initial.value),
            f"{self._back_end}: {statistics['return_status']}",
        )


def make_solver(
    model: PredictionModel,
    cost: StageCost,
    horizon: int,
    u_max: Sequence[float],
    back_end: BackEnd = "ddp",
    most_iterations: int | None = None,
    *,
    speed_max: Sequence[float] | None = None,
    use_compiler: bool = True,
    scaled: bool = True,
) -> Solver:
    """Return a solver of the optimal control problem; see :func:`ocp.transcribe`.

    ``ddp`` needs a compiler and knows no bounds of the speeds; without the one or with the other
    fatrop takes its place. fatrop evaluates compiled loops over the stages where they can be had,
    and otherwise the problem written out stage by stage, because loops that are not compiled are
    slower still. IPOPT always has the written-out form, as in the paper.

    A further back end of CasADi is a name in ``schema.BackEnd`` and its options in
    :func:`_options`. One of its own kind is a class with the interface of :class:`Solver`, made
    here.

    Parameters
    ----------
    model, cost, horizon
        What is predicted, what it costs, and over how many stages.
    u_max
        Largest magnitudes of the inputs (m,).
    back_end
        Name of the solver to use.
    most_iterations
        Largest number of iterations of a call; None for :data:`MOST_ITERATIONS`.
    speed_max
        Largest |v| and |omega| of a robot whose state holds them; None for no bounds.
    use_compiler
        Whether to use a compiler if there is one.
    scaled
        Whether the objective is scaled by the guess's value; only for solvers of CasADi.
    """
    bounds = bounds_for(model, u_max, speed_max)
    form = "not compiled"
    if back_end == "ddp" and speed_max is not None:
        back_end = "fatrop"
    if back_end != "ipopt" and use_compiler:
        generator = ddp if back_end == "ddp" else stagewise
        try:
            library = compiled.library(generator.source(model, cost, horizon))
        except compiled.NotCompiledError as reason:
            form = f"not compiled: {reason}"
        else:
            rollout = Rollout(model, cost, horizon, library)
            if back_end == "ddp":
                iterations = most_iterations or MOST_ITERATIONS[back_end]
                return DdpSolver(
                    ddp.Improver(library, model, cost, bounds.u_max, iterations), rollout
                )
            numbers = stagewise.parameters_of(model, cost)
            problem = OptimalControlProblem(
                str(library), bounds, horizon, model.size, numbers, disturbance_slice(model).start
            )
            return NlpSolver(problem, rollout, back_end, most_iterations, "compiled", scaled=scaled)
    problem = transcribe(model, cost, horizon, bounds)
    rollout, stand_in = Rollout(model, cost, horizon), "fatrop" if back_end == "ddp" else back_end
    return NlpSolver(problem, rollout, stand_in, most_iterations, form, scaled=scaled)


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

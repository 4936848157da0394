"""The receding-horizon strategy of the paper (section 2.1), made to survive a failing solver.

In each step the optimal control problem is solved anew and the first input is applied. The plan of
the step before, shifted by one stage, is the initial guess, the yardstick that a new plan must not
fall behind, and what goes on when the solver fails.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from koopman_lab.config.controller import BackEnd
from koopman_lab.config.schema import LabConfig
from koopman_lab.errors import ConfigError, ModelError
from koopman_lab.koopman.dictionary import dictionary
from koopman_lab.mpc.configured_cost import stage_cost
from koopman_lab.mpc.disturbance import DisturbanceEstimator, DisturbedPrediction
from koopman_lab.mpc.rollout import Rollout
from koopman_lab.mpc.solver import Plan, Solver, make_solver
from koopman_lab.mpc.stage_costs import StageCost
from koopman_lab.predictors.predictor import PredictionModel

CLEARLY_BETTER = 1e-6
"""Relative gain by which a later start must win, so that rounding does not choose among equals."""

START_EFFORT = 0.25
"""Share of the largest inputs in the first guesses."""


@dataclass(frozen=True)
class Decision:
    """What one step decided.

    Attributes
    ----------
    u
        Input to apply now, (m,).
    plan
        The plan that ``u`` begins.
    solved
        Whether the solver found a plan in this step, used or not.
    iterations
        Iterations of the solver in this step, over all starts.
    failures_in_a_row
        Steps without a solution up to now, 0 after a success.
    """

    u: NDArray[np.float64]
    plan: Plan
    solved: bool
    iterations: int
    failures_in_a_row: int

    def __repr__(self) -> str:
        u = ", ".join(f"{value:.4g}" for value in self.u.tolist())
        how = f"solved in {self.iterations} iterations" if self.solved else "unsolved"
        return f"Decision(u = ({u}), value {self.plan.value:.4g}, {how})"


class RecedingHorizon:
    """Optimises step by step.

    Parameters
    ----------
    solver
        Solves the optimal control problem.
    rollout
        Simulates the prediction model under the same cost and horizon.
    u_max
        Largest magnitudes of the inputs (m,).
    dt_s
        Sampling time in s.
    disturbance
        Corrects the model as it goes; None to plan with the model as it is.
    """

    def __init__(
        self,
        solver: Solver,
        rollout: Rollout,
        u_max: Sequence[float],
        dt_s: float,
        disturbance: DisturbanceEstimator | None = None,
    ) -> None:
        self.solver = solver
        """What solves; may be replaced between two steps."""
        self._rollout = rollout
        self._u_max = np.asarray(u_max, dtype=float)
        self._dt_s = dt_s
        self._robot = rollout.robot
        self._disturbance = disturbance
        self._expected: NDArray[np.float64] | None = None
        self._plan: Plan | None = None
        self._failures = 0

    @property
    def solver_description(self) -> str:
        """Return what solves, in words for a person."""
        return self.solver.description

    def step(self, x: NDArray[np.float64]) -> Decision:
        """Return the input for the measured state ``x`` (n,), relative to the goal.

        States of successive calls are one sampling time apart.
        """
        self._correct_model(x)
        fallback, guesses = self._fallback_and_guesses(x)
        plans = [self.solver.solve(x, guess) for guess in guesses]
        usable = [plan for plan in plans if plan.ok and np.isfinite(plan.value)]
        self._failures = 0 if usable else self._failures + 1
        chosen = fallback
        for plan in usable:
            # A continued plan must only not be fallen behind; among first starts ties are common
            # (a parallel parking manoeuvre has a mirror image) and must not hang on rounding.
            limit = fallback.value if chosen is fallback else chosen.value * (1 - CLEARLY_BETTER)
            if plan.value <= limit:
                chosen = plan
        if usable or self._plan is not None:
            self._plan = chosen
        self._expected = self.advance(x, chosen.inputs[0])
        iterations = sum(plan.iterations for plan in plans)
        return Decision(chosen.inputs[0], chosen, bool(usable), iterations, self._failures)

    def restart(self) -> None:
        """Forget the plan: the robot has stood, or was moved, since it was made."""
        self._plan = self._expected = None
        self._failures = 0

    def _correct_model(self, x: NDArray[np.float64]) -> None:
        if self._disturbance is None:
            return
        if self._expected is None:
            self._disturbance.reset()
            self.solver.disturb(self._disturbance.value)
        else:
            self.solver.disturb(self._disturbance.update(self._expected, x))

    def _fallback_and_guesses(
        self, x: NDArray[np.float64]
    ) -> tuple[Plan, list[NDArray[np.float64]]]:
        """Return the plan to go on with if nothing better is found, and the initial guesses."""
        if self._plan is None:
            return self._as_plan(x, self._braking(x, self._rollout.horizon)), self._first_guesses()
        # What follows the end of the old plan: rest, which braking brings about.
        appended = self._braking(self._plan.states[-1], 1)
        inputs = np.vstack([self._plan.inputs[1:], appended])
        return self._as_plan(x, inputs), [inputs]

    def _as_plan(self, x: NDArray[np.float64], inputs: NDArray[np.float64]) -> Plan:
        states, value = self._rollout(x, inputs)
        return Plan(inputs, states, value, 0, False, "not from the solver")

    def _braking(self, x: NDArray[np.float64], steps: int) -> NDArray[np.float64]:
        """Return inputs (steps, m) that bring the robot to rest as fast as the bounds allow."""
        return self._robot.braking(x, self._u_max, self._dt_s, steps)

    def _first_guesses(self) -> list[NDArray[np.float64]]:
        """Return inputs (H, m) of either sign: for wheels forward and backward, left and right.

        No input at all is a stationary point of parallel parking, where a solver stays.
        """
        course = START_EFFORT * self._robot.effort(self._rollout.horizon)
        signs = itertools.product((1.0, -1.0), repeat=self._robot.input_dim)
        return [np.outer(course, self._u_max * sign) for sign in signs]

    def advance(self, x: NDArray[np.float64], u: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the state (n,) that the model predicts one sampling time after ``x``."""
        return self._rollout.advance(x, u)

    def stage_cost(self, x: NDArray[np.float64], u: NDArray[np.float64]) -> float:
        """Return what a stage costs in the state ``x`` (n,) under the input ``u`` (m,)."""
        return self._rollout.stage_cost(x, u)


def receding_horizon(
    model: PredictionModel,
    config: LabConfig,
    back_end: BackEnd | None = None,
    solver: Solver | None = None,
) -> RecedingHorizon:
    """Return the optimiser that a configuration asks for.

    Parameters
    ----------
    model, config, back_end
        See :func:`solver_of`.
    solver
        Made before for the same; it may serve one optimiser after the other.

    Raises
    ------
    LabError
        See :func:`solver_of`.
    """
    settings, solver = config.controller, solver or solver_of(model, config, back_end)
    disturbance = None
    if settings.offset_free.enabled:
        disturbance = DisturbanceEstimator(settings.offset_free, settings.dt_s)
    return RecedingHorizon(solver, solver.rollout, settings.u_max, settings.dt_s, disturbance)


def planning_problem(
    model: PredictionModel, config: LabConfig
) -> tuple[PredictionModel, StageCost]:
    """Return what a configuration plans with: the model as it is propagated, and the stage cost.

    No solver is made for it, so this is the cheap way to see whether one could be.

    Parameters
    ----------
    model
        Predicts the robot; a Koopman surrogate is reprojected or not as configured.
    config
        The lab.

    Raises
    ------
    ModelError
        If the model is of another robot or another sampling time than the configuration.
    ConfigError
        If the weights do not fit the cost.
    """
    settings = config.controller
    if not settings.reprojection:
        model = model.without_reprojection()
    if settings.offset_free.enabled:
        if model.propagates != "state":
            raise ConfigError(
                "controller.offset_free.enabled needs controller.reprojection: what is corrected "
                "in each step is the state; switch one of them"
            )
        model = DisturbedPrediction(model)
    if model.robot.name != config.robot.kind:
        raise ModelError(
            f"the prediction model is of the {model.robot.name} robot, but robot.kind is "
            f"{config.robot.kind}; train a model for it or choose the other robot"
        )
    if abs(model.dt_s - settings.dt_s) > 1e-9:
        raise ModelError(
            f"the prediction model has a sampling time of {model.dt_s} s, but controller.dt_s is "
            f"{settings.dt_s}; train with --dt {settings.dt_s} or set controller.dt_s"
        )
    configured = dictionary(config.model.dictionary, config.robot.kind)
    return model, stage_cost(settings, model.robot, model.dictionary or configured)


def solver_of(model: PredictionModel, config: LabConfig, back_end: BackEnd | None = None) -> Solver:
    """Return the solver that a configuration asks for.

    Parameters
    ----------
    model, config
        See :func:`planning_problem`.
    back_end
        Name of the solver; None for the configured one.

    Raises
    ------
    LabError
        See :func:`planning_problem`.
    """
    model, cost = planning_problem(model, config)
    settings = config.controller
    return make_solver(
        model,
        cost,
        settings.horizon,
        settings.u_max,
        back_end or settings.solver,
        speed_max=settings.speed_max,
        use_compiler=settings.use_compiler,
    )

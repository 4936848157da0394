"""The closed loop on the nominal equations, as in all simulations of the paper (section 4).

No bus, no clock, no noise: what a controller does that the model error alone explains. A run
depends on nothing but its arguments, so that a pool of processes can share the work of a study.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from koopman_lab.config.schema import LabConfig
from koopman_lab.mpc.prediction import PredictionModel
from koopman_lab.mpc.receding_horizon import receding_horizon
from koopman_lab.mpc.solver import Solver
from koopman_lab.robots.nominal_model import nominal_model

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Run:
    """What a simulation did; K steps.

    Attributes
    ----------
    time_s
        Of each state, (K + 1,).
    states
        (K + 1, n), relative to the goal.
    inputs
        (K, 2).
    values
        Value function in the first K states, (K,).
    iterations
        Of the solver in each step, (K,).
    unsolved
        Number of steps in which the solver found nothing.
    """

    time_s: Array
    states: Array
    inputs: Array
    values: Array
    iterations: NDArray[np.int_]
    unsolved: int


COLUMNS = (
    *("time_s", "x1_m", "x2_m", "theta_rad", "v_m_per_s", "omega_rad_per_s"),
    *("u1", "u2", "value"),
)


def closed_loop(
    config: LabConfig,
    prediction: PredictionModel,
    x0: Array,
    duration_s: float,
    solver: Solver | None = None,
) -> Run:
    """Control the nominal robot from a state on.

    Parameters
    ----------
    config
        The lab; of it only the robot's kind and the controller matter.
    prediction
        What the controller predicts with.
    x0
        State (n,) relative to the goal.
    duration_s
        Length of the run, rounded to whole sampling times.
    solver
        From :func:`~koopman_lab.mpc.receding_horizon.solver_of` for the same configuration and
        model; building one takes as long as some tens of steps.

    Raises
    ------
    LabError
        If configuration and model do not fit.
    """
    optimiser = receding_horizon(prediction, config, solver=solver)
    robot, dt_s = nominal_model(config.robot.kind), config.controller.dt_s
    steps = round(duration_s / dt_s)
    x = np.asarray(x0, float)
    states, decisions = [x], []
    for _ in range(steps):
        decision = optimiser.step(x)
        x = robot.step(x, decision.u, dt_s)
        states.append(x)
        decisions.append(decision)
    return Run(
        dt_s * np.arange(steps + 1, dtype=np.float64),
        np.array(states),
        np.array([d.u for d in decisions]).reshape(steps, 2),
        np.array([d.plan.value for d in decisions]),
        np.array([d.iterations for d in decisions], int),
        sum(not d.solved for d in decisions),
    )


def as_rows(run: Run) -> list[list[Any]]:
    """Return a line of :data:`COLUMNS` for each step; the kinematic robot has no speeds."""
    return [
        [t, *x, *[None] * (5 - len(x)), *u, value]
        for t, x, u, value in zip(
            run.time_s[:-1].tolist(),
            run.states[:-1].tolist(),
            run.inputs.tolist(),
            run.values.tolist(),
            strict=True,
        )
    ]


def x2_last_mm(run: Run) -> float:
    """Return the largest |x2| of the last second in mm; the robot may sway about the goal."""
    last = run.time_s >= run.time_s[-1] - 1.0
    return float(1e3 * np.abs(run.states[last, 1]).max())

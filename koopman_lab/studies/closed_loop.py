"""The closed loop on the nominal equations, as in all simulations of the paper (section 4).

No bus, no clock, no noise: what a controller does that the model error alone explains. A run
depends on nothing but its arguments, so that a pool of processes can share the work of a study.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from koopman_lab.config.schema import LabConfig
from koopman_lab.mpc.receding_horizon import receding_horizon
from koopman_lab.mpc.solver import Solver
from koopman_lab.predictors.predictor import PredictionModel
from koopman_lab.robots.robot_type import POSE_DIM, RobotType
from koopman_lab.robots.table import robot_type

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Run:
    """What a simulation did; K steps.

    Attributes
    ----------
    time_s
        Time of each state, (K + 1,).
    states
        States (K + 1, n), relative to the goal.
    inputs
        Inputs (K, m).
    values
        Value function in the first K states, (K,).
    iterations
        Iterations of the solver in each step, (K,).
    unsolved
        Number of steps in which the solver found nothing.
    """

    time_s: Array
    states: Array
    inputs: Array
    values: Array
    iterations: NDArray[np.int_]
    unsolved: int

    def __repr__(self) -> str:
        start, end = (
            ", ".join(f"{value:.4g}" for value in x.tolist()) for x in self.states[[0, -1]]
        )
        return (
            f"Run({len(self.inputs)} steps in {self.time_s[-1]:g} s, from ({start}) to ({end}), "
            f"{self.unsolved} unsolved)"
        )


SPEEDS = ("v_m_per_s", "omega_rad_per_s")
"""Columns that every table has, also of robots whose state does not hold these speeds."""


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
    robot, dt_s = robot_type(config.robot.kind), config.controller.dt_s
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
        np.array([d.u for d in decisions]).reshape(steps, robot.input_dim),
        np.array([d.plan.value for d in decisions]),
        np.array([d.iterations for d in decisions], int),
        sum(not d.solved for d in decisions),
    )


def columns(robot: RobotType) -> tuple[str, ...]:
    """Return the columns of :func:`row`: time, pose, speeds, other states, inputs, value."""
    other_columns = [robot.states[index].column for index in _other_states(robot)]
    pose = [state.column for state in robot.states[:POSE_DIM]]
    inputs = [f"u{index + 1}" for index in range(robot.input_dim)]
    return ("time_s", *pose, *SPEEDS, *other_columns, *inputs, "value")


def row(
    robot: RobotType,
    time_s: float,
    x: Sequence[float],
    u: Sequence[float],
    value: float,
    no_speed: float | None = None,
) -> list[Any]:
    """Return a line of :func:`columns`; ``no_speed`` stands for speeds that ``x`` does not hold."""
    speeds: list[Any] = [x[index] for index in robot.speeds_at] or [no_speed] * len(SPEEDS)
    other_values = [x[index] for index in _other_states(robot)]
    return [time_s, *x[:POSE_DIM], *speeds, *other_values, *u, value]


def as_rows(run: Run, robot: RobotType) -> list[list[Any]]:
    """Return a line of :func:`columns` for each step."""
    steps = zip(
        run.time_s[:-1].tolist(),
        run.states[:-1].tolist(),
        run.inputs.tolist(),
        run.values.tolist(),
        strict=True,
    )
    return [row(robot, *step) for step in steps]


def _other_states(robot: RobotType) -> list[int]:
    return [k for k in range(POSE_DIM, robot.state_dim) if k not in robot.speeds_at]


def x2_last_mm(run: Run) -> float:
    """Return the largest |x2| of the last second in mm; the robot may sway about the goal."""
    last = run.time_s >= run.time_s[-1] - 1.0
    return float(1e3 * np.abs(run.states[last, 1]).max())

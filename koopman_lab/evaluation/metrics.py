"""Prediction errors over one step and over many (paper, section 5.3), whatever predicts."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from koopman_lab.geometry.planar import wrap_angle
from koopman_lab.predictors.predictor import LearnedModel
from koopman_lab.robots.robot_type import RobotType

Array = NDArray[np.float64]
Predict = Callable[[Array, Array], Array]
"""From states (N, n) and inputs (N, H, m) to the states (N, H + 1, n), the first ones included."""

BATCH = 4096
"""Predictions made in one go; more need more memory and take no less time."""


class Measure(NamedTuple):
    """What a deviation is of.

    ``column`` is its name in tables; ``unit`` is what a person reads it in, ``factor`` of which
    make one of the SI unit.
    """

    name: str
    column: str
    factor: float
    unit: str


MEASURES = (
    Measure("position", "position_m", 1e3, "mm"),
    Measure("angle", "angle_rad", 180.0 / np.pi, "deg"),
    Measure("v", "v_m_per_s", 1e3, "mm/s"),
    Measure("omega", "omega_rad_per_s", 180.0 / np.pi, "deg/s"),
)


@dataclass(frozen=True)
class Errors:
    """Errors of predictions ``steps`` sampling times ahead, from ``starts`` states.

    For the distance (m), the difference of the angle (rad), and those of v (m/s) and omega
    (rad/s): mean, median, 95th percentile, and maximum. None for v and omega of robots whose state
    does not hold them.
    """

    steps: int
    starts: int
    position_mean_m: float
    position_p50_m: float
    position_p95_m: float
    position_max_m: float
    angle_mean_rad: float
    angle_p50_rad: float
    angle_p95_rad: float
    angle_max_rad: float
    v_mean_m_per_s: float | None = None
    v_p50_m_per_s: float | None = None
    v_p95_m_per_s: float | None = None
    v_max_m_per_s: float | None = None
    omega_mean_rad_per_s: float | None = None
    omega_p50_rad_per_s: float | None = None
    omega_p95_rad_per_s: float | None = None
    omega_max_rad_per_s: float | None = None


@dataclass(frozen=True, eq=False)
class Starts:
    """States along trajectories, each with what followed.

    Attributes
    ----------
    x0
        States (N, n) that predictions start from, angles in (-pi, pi].
    inputs
        Inputs (N, H, m) of the sampling times after each.
    truth
        States (N, H, n) at the end of those; NaN where none was measured.
    run
        Number of the run each is from (N,).
    time_s
        Time of each since its run began (N,).
    """

    x0: Array
    inputs: Array
    truth: Array
    run: NDArray[np.int64]
    time_s: Array

    @property
    def horizon(self) -> int:
        """Return the number H of steps."""
        return int(self.inputs.shape[1])


def by_model(model: LearnedModel, *, reproject: bool = True) -> Predict:
    """Return the predictions of a surrogate, with reprojection in each step or without."""
    return lambda x0, inputs: model.predict(x0, inputs, reproject=reproject)


def by_nominal(robot: RobotType, dt_s: float) -> Predict:
    """Return the predictions of the nominal equations."""

    def predict(x0: Array, inputs: Array) -> Array:
        states = [x0]
        for k in range(inputs.shape[1]):
            states.append(robot.step(states[-1], inputs[:, k], dt_s))
        return np.stack(states, axis=1)

    return predict


def measures(robot: RobotType) -> tuple[Measure, ...]:
    """Return what the deviations of a robot are of: its pose, and v and omega if it has them."""
    return MEASURES[: 2 + len(robot.speeds_at)]


def deviations(predicted: Array, true: Array, robot: RobotType) -> Array:
    """Return distances and absolute differences of angle, v and omega, (..., 2) or (..., 4).

    Parameters
    ----------
    predicted, true
        States (..., n).
    robot
        The robot; v and omega count where its states hold them.
    """
    difference = predicted - true
    distance, angle = (
        np.hypot(difference[..., 0], difference[..., 1]),
        np.abs(wrap_angle(difference[..., 2])),
    )
    speeds = np.abs(difference[..., list(robot.speeds_at)])
    return np.concatenate([np.stack([distance, angle], axis=-1), speeds], axis=-1)


def rolling_deviations(predict: Predict, starts: Starts, robot: RobotType) -> Array:
    """Return the deviations (N, H, 2 or 4) of predictions from all states along trajectories.

    NaN where the truth is not known.
    """
    batches = [np.zeros((0, starts.horizon, len(measures(robot))))]
    for begin in range(0, len(starts.x0), BATCH):
        part = slice(begin, begin + BATCH)
        predicted = predict(starts.x0[part], starts.inputs[part])
        batches.append(deviations(predicted[:, 1:], starts.truth[part], robot))
    return np.concatenate(batches)


def summary(rows: Array, steps: int) -> Errors | None:
    """Return what deviations (N, 2 or 4) come to; None if no truth is known.

    Parameters
    ----------
    rows
        Deviations after one number of steps, from :func:`deviations`.
    steps
        How far ahead they were predicted.
    """
    known = rows[np.isfinite(rows).all(axis=-1)]
    if not len(known):
        return None
    mean, largest = known.mean(axis=0), known.max(axis=0)
    median, high = np.percentile(known, [50, 95], axis=0)
    table = np.column_stack([mean, median, high, largest])
    return Errors(steps, len(known), *table.ravel().tolist())


def errors_over_time(rolled: Array, starts: Starts, bin_s: float) -> tuple[Array, Array, Array]:
    """Return how deviations go along a trajectory: over all runs, by the time of their starts.

    Parameters
    ----------
    rolled
        From :func:`rolling_deviations`.
    starts
        What the deviations start from.
    bin_s
        Starts so close in time (s) count as one.

    Returns
    -------
    Times (B,) in s, and the means and the largest (B, H, 2 or 4) there; NaN where none is known.
    """
    numbers = np.rint(starts.time_s / bin_s).astype(np.int64)
    order = np.argsort(numbers, kind="stable")
    bins, first = np.unique(numbers[order], return_index=True)
    values, known = rolled[order], np.isfinite(rolled[order])
    count = np.add.reduceat(known, first, axis=0, dtype=float)
    total = np.add.reduceat(np.where(known, values, 0.0), first, axis=0)
    mean = np.divide(total, count, out=np.full_like(total, np.nan), where=count > 0.0)
    largest: Array = np.fmax.reduceat(values, first, axis=0)
    return (bins * bin_s).astype(np.float64), mean, largest


def per_step(rolled: Array) -> Sequence[Errors | None]:
    """Return the errors of 1, 2, ..., H steps from the deviations (N, H, 2 or 4)."""
    return [summary(rolled[:, k], k + 1) for k in range(rolled.shape[1])]

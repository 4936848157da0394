"""Measures of the claims: functions that read a number from the files of the steps."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from offboard.reproduction.paper.step_results import StepResults

Array = NDArray[np.float64]
Measure = Callable[[StepResults], float]

JITTER_AXES = {"v": "v_m_per_s", "omega": "omega_rad_per_s"}
"""Columns of the figure of samples."""


def setting(step: str, *keys: str | int) -> Measure:
    """Measure a value of a step's configuration; whole numbers pick from lists."""

    def measure(results: StepResults) -> float:
        value = results.config(step, *(key for key in keys if isinstance(key, str)))
        for key in keys:
            if isinstance(key, int):
                value = value[key]
        return float(value)

    return measure


def fact(step: str, *keys: str) -> Measure:
    """Measure a number in a step's summary."""
    return lambda results: float(results.summary(step, *keys))


def simulated_x2_mm(step: str, controller: str) -> Measure:
    """Measure |x2| at the end of a simulation in mm."""
    return fact(step, "controllers", controller, "x2_mm")


def parked_x2_mm(step: str, controller: str) -> Measure:
    """Measure |x2| at the end of a lab run in mm."""
    return lambda results: 1e3 * abs(_final(results, step, controller)[1])


def distance_mm(step: str, controller: str) -> Measure:
    """Measure how far from the goal a lab run ended, in mm."""
    return lambda results: 1e3 * float(np.hypot(*_final(results, step, controller)[:2]))


def parked(step: str, controller: str) -> Measure:
    """Measure whether a lab run ended in the neighbourhood of the goal: 1 or 0."""
    return lambda results: float(results.summary(step, "controllers", controller, "parked"))


def share_below(study: str, case: str, limit_mm: float) -> Measure:
    """Measure the share of a study's runs that end with |x2| below a limit."""
    return lambda results: float(np.mean(results.ends_mm(study, case) < limit_mm))


def share_above(study: str, case: str, limit_mm: float) -> Measure:
    """Measure the share of a study's runs that end with |x2| above a limit, or fail."""
    return lambda results: float(np.mean(results.ends_mm(study, case) > limit_mm))


def quantile_mm(study: str, case: str, q: float) -> Measure:
    """Measure a quantile of |x2| over a study's runs in mm, one that was really met."""
    return lambda results: float(
        np.quantile(results.ends_mm(study, case), q, method="inverted_cdf")
    )


def median_of_grid_mm(step: str, cost: str) -> Measure:
    """Measure the median of |x2| over the settings of a cost in `klab study weights`, in mm."""
    return lambda results: float(
        np.median(results.column(step, f"{step}.csv", "x2_last_mm", cost=cost))
    )


def runs(study: str, case: str) -> Measure:
    """Measure how many runs a case of a study has."""
    return lambda results: float(len(results.ends_mm(study, case)))


def scaled(factor: float, number: Measure) -> Measure:
    """Measure a number in another unit."""
    return lambda results: factor * number(results)


def ratio(above: Measure, below: Measure) -> Measure:
    """Measure how many times one number is the other."""

    def measure(results: StepResults) -> float:
        numerator, denominator = above(results), below(results)
        if denominator == 0.0:
            return float("inf") if numerator > 0.0 else float("nan")
        return numerator / denominator

    return measure


def lost(case: Measure, reference: Measure) -> Measure:
    """Measure by how much one share is below another."""
    return lambda results: reference(results) - case(results)


def paths_apart_m(step: str, one: str, other: str) -> Measure:
    """Measure the largest distance between two simulated paths at the same time, in m."""

    def measure(results: StepResults) -> float:
        paths = [
            np.column_stack([results.column(step, f"{name}.csv", x) for x in ("x1_m", "x2_m")])
            for name in (one, other)
        ]
        return float(np.linalg.norm(paths[0] - paths[1], axis=1).max())

    return measure


def value_falls(step: str, controller: str) -> Measure:
    """Measure how many times smaller the value function is at the end of a simulation."""

    def measure(results: StepResults) -> float:
        values = results.column(step, f"{controller}.csv", "value")
        return float(values[0] / max(values[-1], np.finfo(float).tiny))

    return measure


def predicted(
    step: str, name: str, model: str, steps: int, *, shape: str = "infinity", reproject: bool = True
) -> Measure:
    """Measure an error in the table of `klab validate`; the nominal equations are a model too."""
    how = {} if model == "nominal" else {"reprojection": str(reproject)}

    def measure(results: StepResults) -> float:
        where = {"shape": shape, "model": model, "steps": str(steps)} | how
        return float(results.column(step, "validation.csv", name, **where)[0])

    return measure


def largest_ahead(step: str, name: str, model: str, steps: int) -> Measure:
    """Measure the largest error of all starts and runs in the table of `klab figure multistep`."""

    def measure(results: StepResults) -> float:
        where = {"predictor": model, "steps": str(steps)}
        return float(results.column(step, f"{step}.csv", f"largest_{name}", **where).max())

    return measure


def share_better(step: str, name: str, model: str) -> Measure:
    """Measure at which share of starts and steps a model's mean error is below the nominal one."""

    def measure(results: StepResults) -> float:
        ours, theirs = (
            results.column(step, f"{step}.csv", f"mean_{name}", predictor=predictor)
            for predictor in (model, "nominal")
        )
        return float(np.mean(ours < theirs))

    return measure


def mean_ahead(step: str, name: str, model: str, steps: int) -> Measure:
    """Measure the error averaged over runs and starts in the table of `klab figure multistep`."""

    def measure(results: StepResults) -> float:
        where = {"predictor": model, "steps": str(steps)}
        return float(results.column(step, f"{step}.csv", f"mean_{name}", **where).mean())

    return measure


def most_steps(step: str) -> Measure:
    """Measure how many steps the table of `klab figure multistep` looks ahead."""
    return lambda results: float(results.column(step, f"{step}.csv", "steps").max())


def off_path_m(step: str, shape: str, model: str, *, until: float = 1.0) -> Measure:
    """Measure how far the open-loop prediction of a run gets from the averaged runs, in m.

    Up to a share ``until`` of the run's time.
    """

    def measure(results: StepResults) -> float:
        predicted_path, driven = (
            _path_of(results, step, shape, source) for source in (model, "driven")
        )
        apart = np.linalg.norm(predicted_path - driven, axis=1)
        return float(apart[: max(1, round(until * len(apart)))].max())

    return measure


def turned_too_far_rad(step: str, shape: str, model: str) -> Measure:
    """Measure by how much the predicted heading is ahead of the driven one at the end, in rad."""

    def measure(results: StepResults) -> float:
        headings = [
            results.column(step, "dictionaries-paths.csv", "theta_rad", shape=shape, model=source)
            for source in (model, "driven")
        ]
        return float(headings[0][-1] - headings[1][-1])

    return measure


def jitter(step: str, axis: str, window: int) -> Measure:
    """Measure the noise left in a smoothed velocity: how it jumps between frames (m/s, rad/s).

    The desired velocities are constant or linear, so what jumps about the mean slope is noise.
    """

    def measure(results: StepResults) -> float:
        jumps = []
        for index in ("0", "1", "2"):
            where = {"basis_index": index, "window": str(window)}
            values = results.column(step, "samples-velocities.csv", JITTER_AXES[axis], **where)
            steps = np.diff(values)
            jumps.append(steps - steps.mean())
        return float(np.sqrt(np.mean(np.concatenate(jumps) ** 2)))

    return measure


def share_cut_short(step: str, basis_index: int, longest: int) -> Measure:
    """Measure the share of runs that ended before their time, in sampling times, was over."""

    def measure(results: StepResults) -> float:
        file = "samples-positions.csv"
        numbers = results.column(step, file, "run", basis_index=str(basis_index))
        lengths = np.unique(numbers, return_counts=True)[1]
        return float(np.mean(lengths < longest))

    return measure


def largest_over_smallest(step: str, name: str, windows: tuple[int, ...]) -> Measure:
    """Measure how far a column of `klab dataset sweep` varies with the window, as a factor."""

    def measure(results: StepResults) -> float:
        values = [results.column(step, f"{step}.csv", name, window=str(w))[0] for w in windows]
        return float(max(values) / min(values))

    return measure


def _final(results: StepResults, step: str, controller: str) -> Array:
    pose = results.summary(step, "controllers", controller, "final_pose")
    return np.array(pose if pose is not None else [np.nan] * 3, float)


def _path_of(results: StepResults, step: str, shape: str, source: str) -> Array:
    file = "dictionaries-paths.csv"
    return np.column_stack(
        [results.column(step, file, x, shape=shape, model=source) for x in ("x1_m", "x2_m")]
    )

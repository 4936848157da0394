"""Open-loop predictions of several dictionaries, and their one-step errors (paper, section 5.3)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from koopman_lab.data.reference_trajectories import ReferenceRuns, Trajectory, mean_inputs
from koopman_lab.evaluation.metrics import MEASURES, errors_over_time, measures, rolling_deviations
from koopman_lab.evaluation.validation import NOMINAL, common_dt_s, predictors, starts_by_offset
from koopman_lab.figures.canvas import new_figure, save
from koopman_lab.files import write_csv
from koopman_lab.predictors.predictor import LearnedModel
from koopman_lab.units import US_PER_S

Array = NDArray[np.float64]
COLOURS = ("tab:blue", "tab:orange", "tab:green", "tab:purple", "tab:brown", "tab:cyan")
"""Colours of models, in turn; the runs are red, the nominal equations black."""
MARGIN_M = 0.25
"""Margin around what the robot drove; predictions may leave the picture."""
DRIVEN = "driven"
"""Names the average of the runs in the table of paths."""


class OpenLoop(NamedTuple):
    """What one predictor predicts on one shape.

    Attributes
    ----------
    path
        States (T + 1, n) predicted from the nominal start with the inputs of a whole run.
    time_s, one_step
        Times (B,) in s along the runs, and there the one-step errors (B, 2 or 4), averaged over
        the runs: m, rad and, for robots whose state holds v and omega, m/s, rad/s.
    """

    path: Array
    time_s: Array
    one_step: Array


def open_loop(models: Mapping[str, LearnedModel], runs: ReferenceRuns) -> dict[str, OpenLoop]:
    """Return the predictions of models by name, with reprojection, and of the nominal equations."""
    dt_s = common_dt_s(models)
    compared = [p for p in predictors(models) if p.reprojection is not False]
    first = runs.trajectories(compared[0].marker_offset)[0]
    dt_us = dt_s * US_PER_S
    begins = np.arange(0.0, first.end_us - first.start_us - 0.5 * dt_us, dt_us)
    inputs = mean_inputs(first, begins, dt_us)
    starts = starts_by_offset(compared, runs, 1, dt_s)
    predictions = {}
    for predictor in compared:
        from_states = starts[predictor.marker_offset]
        path = predictor.predict(runs.start[None], inputs[None])[0]
        time_s, mean, _ = errors_over_time(
            rolling_deviations(predictor.predict, from_states, runs.robot), from_states, dt_s
        )
        predictions[predictor.model] = OpenLoop(path, time_s, mean[:, 0])
    return predictions


def averaged(runs: Sequence[Trajectory], dt_s: float) -> Array:
    """Return the states (T + 1, n) that runs average to, a sampling time apart from their starts.

    The angle goes on beyond pi.
    """
    dt_us = dt_s * US_PER_S
    last_us = min(run.end_us - run.start_us for run in runs)
    at_us = np.arange(0.0, last_us + 0.5 * dt_us, dt_us)
    paths = []
    for run in runs:
        x = run.x.copy()
        x[:, 2] = np.unwrap(x[:, 2])
        since_us = (run.utime_us - run.start_us).astype(float)
        paths.append(np.column_stack([np.interp(at_us, since_us, column) for column in x.T]))
    return np.asarray(np.mean(paths, axis=0), float)


def draw_dictionaries(
    stem: Path, models: Mapping[str, LearnedModel], sessions: Sequence[ReferenceRuns]
) -> None:
    """Write ``stem.pdf``, ``stem.png``, ``stem-paths.csv`` and ``stem-one-step.csv``.

    A column each session: what was driven and what each model predicts, below that the one-step
    errors, of the pose as solid lines and of the velocities as dotted ones. The table of paths has
    the average of the runs as well.

    Parameters
    ----------
    stem
        Path without ending.
    models
        Models by name.
    sessions
        Reference runs of one robot, that of the models.
    """
    figure = new_figure(width=6.2 * len(sessions), height=10.0)
    columns = figure.subplots(3, len(sessions), squeeze=False, height_ratios=(2.0, 1.0, 1.0)).T
    paths: list[tuple[object, ...]] = []
    errors: list[tuple[object, ...]] = []
    dt_s = common_dt_s(models)
    for (plane, translation, rotation), runs in zip(columns, sessions, strict=True):
        predictions = open_loop(models, runs)
        trajectories = runs.trajectories(next(iter(models.values())).marker_offset)
        _draw_plane(plane, runs.shape, trajectories, predictions)
        for k, (axes, name) in enumerate(((translation, "position"), (rotation, "angle"))):
            _draw_errors(axes, predictions, k)
            axes.set(xlabel="time (s)", ylabel=f"one-step error, {name} ({MEASURES[k].unit})")
        driven = averaged(trajectories, dt_s).tolist()
        paths += [(runs.shape, DRIVEN, k * dt_s, *x) for k, x in enumerate(driven)]
        for name, prediction in predictions.items():
            paths += [
                (runs.shape, name, k * dt_s, *x) for k, x in enumerate(prediction.path.tolist())
            ]
            rows = zip(prediction.time_s.tolist(), prediction.one_step.tolist(), strict=True)
            errors += [(runs.shape, name, t, *row) for t, row in rows]
    handles, labels = columns[0][0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=len(labels), fontsize="small")
    save(figure, stem)
    robot = sessions[0].robot
    states = [state.column for state in robot.states]
    write_csv(_csv_path(stem, "paths"), ("shape", "model", "time_s", *states), paths)
    measured = [measure.column for measure in measures(robot)]
    write_csv(_csv_path(stem, "one-step"), ("shape", "model", "time_s", *measured), errors)


def _draw_plane(
    plane: Axes, shape: str, runs: Sequence[Trajectory], predictions: Mapping[str, OpenLoop]
) -> None:
    driven = [t.x[(t.utime_us >= t.start_us) & (t.utime_us <= t.end_us)] for t in runs]
    for x in driven:
        label = f"{len(driven)} runs" if x is driven[0] else None
        plane.plot(x[:, 0], x[:, 1], color="tab:red", alpha=0.25, linewidth=0.8, label=label)
    for k, (name, prediction) in enumerate(predictions.items()):
        line = "--" if name == NOMINAL else "-"
        plane.plot(
            prediction.path[:, 0], prediction.path[:, 1], line, color=_colour(name, k), label=name
        )
    poses = np.concatenate([*driven, predictions[NOMINAL].path])[:, :2]
    (left, bottom), (right, top) = poses.min(axis=0) - MARGIN_M, poses.max(axis=0) + MARGIN_M
    plane.set(xlim=(left, right), ylim=(bottom, top), aspect="equal", title=shape)
    plane.set(xlabel="$x_1$ (m)", ylabel="$x_2$ (m)")
    plane.grid(visible=True)


def _draw_errors(axes: Axes, predictions: Mapping[str, OpenLoop], measure_index: int) -> None:
    """Draw position and v (``measure_index`` 0), or angle and omega (1), on two scales."""
    fast = axes.twinx() if predictions[NOMINAL].one_step.shape[1] > 2 else None
    for k, (name, prediction) in enumerate(predictions.items()):
        colour = _colour(name, k)
        axes.plot(
            prediction.time_s,
            MEASURES[measure_index].factor * prediction.one_step[:, measure_index],
            color=colour,
            linewidth=0.9,
        )
        if fast is not None:
            speed = MEASURES[measure_index + 2]
            values = speed.factor * prediction.one_step[:, measure_index + 2]
            fast.plot(prediction.time_s, values, ":", color=colour, linewidth=0.7)
            fast.set(ylabel=f"velocity ({speed.unit}), dotted", yscale="log")
    axes.set(yscale="log")
    axes.grid(visible=True)


def _colour(name: str, number: int) -> str:
    return "black" if name == NOMINAL else COLOURS[number % len(COLOURS)]


def _csv_path(stem: Path, what: str) -> Path:
    return stem.with_name(f"{stem.with_suffix('').name}-{what}.csv")

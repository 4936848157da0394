"""Multi-step errors along a shape, averaged over runs and the largest (paper, section 5.3)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from koopman_lab.data.reference_trajectories import ReferenceRuns
from koopman_lab.evaluation.metrics import MEASURES, errors_over_time, rolling_deviations
from koopman_lab.evaluation.trajectory_starts import starts_along
from koopman_lab.evaluation.validation import predictors
from koopman_lab.figures.canvas import new_figure, save
from koopman_lab.files import write_csv
from koopman_lab.predictors.predictor import LearnedModel

COLOURS = ("tab:blue", "tab:red", "black")
"""The paper's colours: with reprojection, without, nominal."""
FAINTEST = 0.15
"""Opacity of one step; that of the last one is 1."""


class MultiStep(NamedTuple):
    """Errors of one predictor along the runs.

    ``time_s`` (B,) of the starts, ``mean`` and ``largest`` (B, H, 2 or 4) over all runs: m, rad
    and, for robots whose state holds v and omega, m/s, rad/s.
    """

    reprojection: bool | None
    time_s: NDArray[np.float64]
    mean: NDArray[np.float64]
    largest: NDArray[np.float64]


def multi_step(
    name: str, model: LearnedModel, runs: ReferenceRuns, steps: int
) -> dict[str, MultiStep]:
    """Return the errors with reprojection, without, and of the nominal equations, by label."""
    trajectories = runs.trajectories(model.marker_offset)
    starts = starts_along(trajectories, steps, model.dt_s, runs.config.mocap.rate_hz)
    return {
        p.label: MultiStep(
            p.reprojection,
            *errors_over_time(
                rolling_deviations(p.predict, starts, model.robot), starts, model.dt_s
            ),
        )
        for p in predictors({name: model})
    }


def draw_multi_step(stem: Path, curves: Mapping[str, MultiStep], title: str) -> None:
    """Write ``stem.pdf``, ``stem.png`` and the numbers as ``stem.csv``.

    Opacity grows with the number of steps. As in the paper, the largest errors are shown without
    those of the prediction without reprojection, which would dwarf the others; the numbers have
    them.

    Parameters
    ----------
    stem
        Path without ending.
    curves
        From :func:`multi_step`.
    title
        Title, which says what the errors are of.
    """
    measured = next(iter(curves.values())).mean.shape[2]
    figure = new_figure(width=12.0, height=2.4 * measured + 0.8)
    for k, (left, right) in enumerate(figure.subplots(measured, 2, sharex=True)):
        name, _, factor, unit = MEASURES[k]
        for (label, curve), colour in zip(curves.items(), COLOURS, strict=True):
            _draw_steps(left, curve.time_s, factor * curve.mean[:, :, k], colour, label)
            if curve.reprojection is not False:
                _draw_steps(right, curve.time_s, factor * curve.largest[:, :, k], colour, label)
        left.set(ylabel=f"{name} ({unit})", title="averaged over runs" if k == 0 else None)
        right.set(title="largest of all runs" if k == 0 else None)
        for axes in (left, right):
            axes.grid(visible=True)
            if k == measured - 1:
                axes.set(xlabel="time of the start (s)")
        if k == 0:
            figure.legend(
                *left.get_legend_handles_labels(), loc="outside upper center", ncols=3, title=title
            )
    save(figure, stem)
    columns = [measure.column for measure in MEASURES[:measured]]
    columns = [f"{m}_{name}" for m in ("mean", "largest") for name in columns]
    write_csv(stem.with_suffix(".csv"), ("predictor", "steps", "time_s", *columns), _lines(curves))


def _draw_steps(
    axes: Axes,
    time_s: NDArray[np.float64],
    values: NDArray[np.float64],
    colour: str,
    label: str,
) -> None:
    steps = values.shape[1]
    for k in range(steps):
        opacity = FAINTEST + (1.0 - FAINTEST) * (k + 1) / steps
        last = label if k == steps - 1 else None
        axes.plot(time_s, values[:, k], color=colour, alpha=opacity, linewidth=0.6, label=last)


def _lines(curves: Mapping[str, MultiStep]) -> Sequence[Sequence[object]]:
    return [
        (label, k + 1, t, *curve.mean[i, k].tolist(), *curve.largest[i, k].tolist())
        for label, curve in curves.items()
        for k in range(curve.mean.shape[1])
        for i, t in enumerate(curve.time_s.tolist())
        if np.isfinite(curve.mean[i, k, 0])
    ]

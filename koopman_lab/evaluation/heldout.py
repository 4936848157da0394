"""Errors of a model on segments that it was not trained with."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from koopman_lab.data.dataset import DataSet
from koopman_lab.data.time_shift import shifted_pairs
from koopman_lab.evaluation.metrics import Errors, deviations, measures, summary
from koopman_lab.predictors.predictor import LearnedModel
from koopman_lab.units import US_PER_S

Array = NDArray[np.float64]
EVERY = 5
"""Every fifth run of each basis input is held out."""
MOST_STARTS = 2000
"""Largest number of predictions for each basis input; more change nothing."""

Runs = dict[int, NDArray[np.int64]]
"""Maps a basis index to numbers of runs (k,)."""


def held_out_runs(dataset: DataSet, every: int = EVERY) -> Runs:
    """Return every ``every``-th run of each basis input."""
    return {i: np.unique(numbers)[every - 1 :: every] for i, numbers in dataset.segments.items()}


def split(dataset: DataSet, held_out: Runs) -> tuple[DataSet, DataSet]:
    """Return the data set without, and with only, these runs."""
    inside = {i: np.isin(numbers, held_out[i]) for i, numbers in dataset.segments.items()}
    outside = {i: ~mask for i, mask in inside.items()}
    return select_pairs(dataset, outside), select_pairs(dataset, inside)


def select_pairs(dataset: DataSet, chosen: dict[int, NDArray[np.bool_]]) -> DataSet:
    """Return the data set with the chosen pairs (d,) of each basis input."""
    return replace(
        dataset,
        X={i: x[chosen[i]] for i, x in dataset.X.items()},
        Y={i: y[chosen[i]] for i, y in dataset.Y.items()},
        segments={i: s[chosen[i]] for i, s in dataset.segments.items()},
        start_us={i: s[chosen[i]] for i, s in dataset.start_us.items()},
    )


def errors(model: LearnedModel, dataset: DataSet, steps: int) -> Errors | None:
    """Return the errors of predictions over runs of a data set; None if no run is long enough.

    The state after ``steps`` sampling times is the successor of the one that ``steps - 1`` later
    began a pair of the same run.

    Parameters
    ----------
    model
        The model, which predicts with reprojection.
    dataset
        Has runs of the basis inputs.
    steps
        How far ahead, at least 1.
    """
    parts = [np.zeros((0, len(measures(model.robot))))]
    for index, u in dataset.basis_inputs.items():
        starts, ends = _matched(dataset, index, steps)
        if not len(starts):
            continue
        x0, x_end = dataset.X[index][starts], dataset.Y[index][ends]
        inputs = np.broadcast_to(u, (len(x0), steps, len(u)))
        parts.append(deviations(model.predict(x0, inputs)[:, -1], x_end, model.robot))
    return summary(np.concatenate(parts), steps)


def _matched(dataset: DataSet, index: int, steps: int) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return pairs (k,) and those (k,) that begin ``steps - 1`` sampling times later."""
    starts = np.arange(len(dataset.X[index]))
    ends = starts
    if steps > 1:
        ahead_us = round((steps - 1) * dataset.dt_s * US_PER_S)
        starts, ends = shifted_pairs(dataset, index, ahead_us)
    every = 1 + len(starts) // MOST_STARTS
    return starts[::every], ends[::every]

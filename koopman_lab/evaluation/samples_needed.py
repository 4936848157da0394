"""How many samples a fit needs: errors against their number (paper, section 5.4 and outlook).

Samples within a run lie on one curve, so they are drawn across runs: the runs of each basis input
with replacement, as a bootstrap does, and the samples from all runs drawn. Repeated, this says how
much luck there is in a number of samples, also where it is all there are.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from koopman_lab.data.dataset import DataSet
from koopman_lab.errors import DataError
from koopman_lab.evaluation.heldout import errors, held_out_runs, split
from koopman_lab.koopman.basis_fit import fit_all, moments_of
from koopman_lab.koopman.bilinear_model import BilinearModel
from koopman_lab.koopman.dictionary import Dictionary
from koopman_lab.koopman.lifted_samples import lifted_samples
from koopman_lab.koopman.training_report import Method

COUNTS = (5, 10, 20, 50, 100, 200, 500, 1000, 2000, 5000, 10_000, 20_000, 50_000, 100_000)
STEPS = 20
"""The paper's horizon of the multi-step errors."""
BAND = (5.0, 50.0, 95.0)
"""Percentiles over the repetitions."""
METHODS = {
    "plain": Method(),
    "noise-aware": Method(estimator="iv"),
    "symmetric": Method(symmetric=True),
    "both": Method(estimator="iv", symmetric=True),
}


@dataclass(frozen=True)
class NeededRow:
    """Errors of fits with so many samples for each basis input, on runs that no fit has seen.

    ``position_m`` and ``angle_rad`` are the percentiles of :data:`BAND` over the repetitions, of
    the mean error after :data:`STEPS` steps; None if all repetitions were refused.
    """

    method: str
    count: int
    repetitions: int
    refused: int
    position_m: tuple[float, float, float] | None
    angle_rad: tuple[float, float, float] | None


def counts_of(dataset: DataSet) -> list[int]:
    """Return the numbers of samples to try: those of :data:`COUNTS` there are, and all."""
    largest = max(map(len, split(dataset, held_out_runs(dataset))[0].X.values()))
    return [count for count in COUNTS if count < largest] + [largest]


def errors_by_count(
    dataset: DataSet,
    dictionary: Dictionary,
    counts: Sequence[int],
    repetitions: int,
    *,
    methods: Sequence[str] = tuple(METHODS),
    seed: int = 0,
) -> Iterator[NeededRow]:
    """Fit with more and more samples.

    Parameters
    ----------
    dataset
        Pairs of a session; every fifth run is held out.
    dictionary
        The dictionary; where it cannot be symmetric, leave those methods out.
    counts
        Samples for each basis input.
    repetitions
        Draws for each count.
    methods
        Names from :data:`METHODS`.
    seed
        Seed of the draws: all methods see the same runs.

    Raises
    ------
    LabError
        If the data do not say what instruments need to know, or the dictionary cannot be
        symmetric.
    """
    training, held_out = split(dataset, held_out_runs(dataset))
    for name in methods:
        method = METHODS[name]
        pool = {
            index: lifted_samples(training, index, dictionary, method.estimator)
            for index in training.X
        }
        for count in counts:
            mean_errors, refused = [], 0
            for repetition in range(repetitions):
                rng = np.random.default_rng([seed, count, repetition])
                moments = {
                    i: moments_of(
                        dictionary, lifted.select(draw(lifted.segments, count, rng, bootstrap=True))
                    )
                    for i, lifted in pool.items()
                }
                try:
                    matrices, inputs, _ = fit_all(dictionary, _inputs(training), moments, method)
                except DataError:
                    refused += 1
                    continue
                model = BilinearModel(dictionary, matrices, inputs, training.dt_s, {})
                with np.errstate(over="ignore", invalid="ignore"):
                    ahead = errors(model, held_out, STEPS)
                if ahead is None:
                    raise DataError(
                        f"no held-out run is {STEPS} sampling times long; record longer ones "
                        "(sampler.largest_steps)"
                    )
                mean_errors.append((ahead.position_mean_m, ahead.angle_mean_rad))
            yield NeededRow(name, count, repetitions, refused, *_bands(mean_errors))


def draw(
    segments: NDArray[np.int64], count: int, rng: np.random.Generator, *, bootstrap: bool = False
) -> NDArray[np.intp]:
    """Return the rows (at most ``count``,) of so many samples, drawn across all runs.

    Parameters
    ----------
    segments
        The run of each sample (d,).
    count
        Number of samples.
    rng
        Generator of the draws.
    bootstrap
        Whether the runs are drawn first, with replacement; without it no sample comes twice.
    """
    rows = np.arange(len(segments))
    if bootstrap:
        numbers = np.unique(segments)
        drawn = rng.choice(numbers, len(numbers))
        rows = np.concatenate([np.flatnonzero(segments == n) for n in drawn])
    return rng.permutation(rows)[:count]


def _bands(
    mean_errors: list[tuple[float, float]],
) -> tuple[tuple[float, float, float] | None, tuple[float, float, float] | None]:
    if not mean_errors:
        return None, None
    position, angle = np.nan_to_num(np.array(mean_errors), nan=np.inf).T
    return _percentiles(position), _percentiles(angle)


def _percentiles(values: NDArray[np.float64]) -> tuple[float, float, float]:
    low, middle, high = np.percentile(values, BAND, method="nearest").tolist()
    return low, middle, high


def _inputs(dataset: DataSet) -> dict[int, Sequence[float]]:
    return {i: u.tolist() for i, u in dataset.basis_inputs.items()}


def as_table(rows: Sequence[NeededRow]) -> tuple[list[str], list[list[Any]]]:
    """Return column names and one line a method and count, None where there is no number."""
    measures = [f"{what}_p{p:g}" for what in ("position_m", "angle_rad") for p in BAND]
    lines = [
        [
            row.method,
            row.count,
            row.repetitions,
            row.refused,
            *(row.position_m or (None,) * 3),
            *(row.angle_rad or (None,) * 3),
        ]
        for row in rows
    ]
    return ["method", "samples", "repetitions", "refused", *measures], lines

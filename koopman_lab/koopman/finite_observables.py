"""Whether observables are numbers wherever they are needed: at every sample, and at the goal.

An expression such as ``sqrt(x2)`` or ``sin(theta)/theta`` is none everywhere. A fit to such samples
is none either, and a controller divides by what is missing just where it is to stand.
"""

from __future__ import annotations

from itertools import product

import numpy as np
from numpy.typing import NDArray

from koopman_lab.data.dataset import DataSet
from koopman_lab.errors import DataError, ModelError
from koopman_lab.koopman.dictionary import Dictionary

Array = NDArray[np.float64]

LARGEST = 1e100
"""Beyond it the squares that a fit sums up are no numbers."""
BESIDE = 1e-3
"""So far from the goal in each state (m, rad, m/s, rad/s) a controller still differentiates."""


def lifted(dictionary: Dictionary, x: Array) -> Array:
    """Return psi (..., M) of states (..., n), without a word about what is no number in it."""
    with np.errstate(all="ignore"):
        return dictionary.lift(x)


def usable(psi: Array) -> NDArray[np.bool_]:
    """Return which values are real numbers that can be computed with."""
    if np.iscomplexobj(psi):
        return np.zeros(psi.shape, bool)
    return np.isfinite(psi) & (np.abs(psi) <= LARGEST)


def require_numbers_at_goal(dictionary: Dictionary) -> None:
    """Refuse a dictionary that is no number at the goal, which is the origin, or just beside it.

    Raises
    ------
    ModelError
        Naming the first such observable.
    """
    states = BESIDE * np.array(list(product((0.0, -1.0, 1.0), repeat=dictionary.state_dim)))
    good = usable(lifted(dictionary, states))
    for row, name in enumerate(dictionary.names):
        if not good[:, row].all():
            state = states[np.argmin(good[:, row])]
            where = "at the goal" if not state.any() else "just beside the goal"
            raise ModelError(
                f"observable {name!r} is no number {where} ({_point(dictionary, state)}), where "
                "the controller needs it most; choose another"
            )


def require_numbers(dictionary: Dictionary, dataset: DataSet) -> None:
    """Refuse observables that are no number for a sample or its successor.

    Raises
    ------
    DataError
        Naming the first such observable, for how many samples that is so, and the first of them.
    """
    samples = [
        (index, row, pair)
        for index in sorted(dataset.X)
        for row, pair in enumerate(zip(dataset.X[index], dataset.Y[index], strict=True))
    ]
    if not samples:
        return
    states = np.array([pair for _, _, pair in samples])
    good = usable(lifted(dictionary, states))
    for column, name in enumerate(dictionary.names):
        bad = ~good[..., column].all(axis=1)
        if bad.any():
            first = int(np.argmax(bad))
            index, row, _ = samples[first]
            state = states[first, int(np.argmin(good[first, :, column]))]
            raise DataError(
                f"observable {name!r} is no number, or too large for one, for {bad.sum()} of "
                f"{len(samples)} samples; the first is sample {row} of basis input {index}, at "
                f"{_point(dictionary, state)}; choose another"
            )


def _point(dictionary: Dictionary, state: Array) -> str:
    names = dictionary.robot.state_names
    return ", ".join(f"{name} = {value:.4g}" for name, value in zip(names, state, strict=True))

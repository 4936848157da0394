"""How well a data set excites a dictionary; looked at before anything is fitted."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from koopman_lab.errors import DataError
from koopman_lab.koopman.dictionary import Dictionary
from koopman_lab.koopman.finite_observables import lifted, usable
from koopman_lab.koopman.moments import Moments

SMALLEST_SHARE = 1e-3
"""Directions weaker than this share of the strongest count as not excited.

Sets that excite the dictionaries of the paper well have a condition between 16 and 120; camera
noise alone, 0.2 mm in a metre, makes directions that are about 2e-4 strong.
"""

REGULARISE = "regularise the fit (--ridge 1e-4, with --estimator plain)"
STATES_AN_OBSERVABLE = 8
"""So many random states tell whether observables depend on each other, whatever the data."""
DEPENDENT = 1e-12
"""An observable of which less than this share is left depends on the others: rounding."""


@dataclass(frozen=True)
class Excitation:
    """What the samples of one basis input span.

    Singular values are those of the lifted samples with columns scaled to unit root mean square,
    so they do not depend on units.
    """

    samples: int
    segments: int
    observables: int
    rank: int
    smallest_singular_value: float
    condition: float

    def require_full_rank(self, dictionary: Dictionary) -> None:
        """Refuse a set that leaves directions of the dictionary open.

        Raises
        ------
        DataError
            With the reason and the remedy.
        """
        self.require_samples()
        if self.rank < self.observables:
            raise DataError(
                f"{self.samples} samples from {self.segments} segments span only {self.rank} of "
                f"the {self.observables} observables of {dictionary.name}; {remedy(dictionary)}"
            )

    def require_samples(self) -> None:
        """Refuse a set that is empty.

        Raises
        ------
        DataError
            With the remedy.
        """
        if self.samples == 0:
            raise DataError("no samples; record more segments with `klab calibrate --segments N`")


def remedy(dictionary: Dictionary) -> str:
    """Return what helps against samples that do not span a dictionary."""
    dependent = dependent_observable(dictionary)
    if dependent is not None:
        return (
            f"no data can, since {dependent!r} is a combination of the observables before it; "
            f"leave it out, or {REGULARISE}"
        )
    return (
        "segments under one constant input lie on few curves, so record more of them, from other "
        f"states (`klab calibrate --segments N`), choose a smaller dictionary, or {REGULARISE}"
    )


def dependent_observable(dictionary: Dictionary) -> str | None:
    """Return the first observable that is a combination of those before it at every state."""
    rng = np.random.default_rng(0)
    x = rng.uniform(-1.0, 1.0, (STATES_AN_OBSERVABLE * dictionary.size, dictionary.state_dim))
    psi = lifted(dictionary, x)
    psi = psi[usable(psi).all(axis=1)]
    scale = np.linalg.norm(psi, axis=0)
    if len(psi) < dictionary.size or not scale.all():
        return None
    # What is left of each column after those before it stands on the diagonal.
    left = np.abs(np.diag(np.linalg.qr(psi / scale, mode="r")))
    dependent = np.flatnonzero(left < DEPENDENT)
    return dictionary.names[dependent[0]] if len(dependent) else None


def excitation(moments: Moments, smallest_share: float = SMALLEST_SHARE) -> Excitation:
    """Return how samples excite the dictionary."""
    samples, observables = moments.samples, moments.observables
    if samples == 0:
        return Excitation(0, 0, observables, 0, 0.0, float("inf"))
    values = np.linalg.svd(moments.x / moments.scale, compute_uv=False) / np.sqrt(samples)
    rank = int(np.sum(values > smallest_share * values[0]))
    smallest = float(values[-1]) if samples >= observables else 0.0
    condition = float(values[0] / smallest) if smallest > 0.0 else float("inf")
    return Excitation(samples, moments.segments, observables, rank, smallest, condition)

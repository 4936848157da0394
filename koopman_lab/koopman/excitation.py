"""How well a data set excites a dictionary; looked at before anything is fitted."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from koopman_lab.errors import DataError
from koopman_lab.koopman.dictionary import Dictionary
from koopman_lab.koopman.moments import Moments

SMALLEST_SHARE = 1e-3
"""Directions weaker than this share of the strongest count as not excited.

Sets that excite the dictionaries of the paper well have a condition between 16 and 120; camera
noise alone, 0.2 mm in a metre, makes directions that are about 2e-4 strong.
"""


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

    def require_full_rank(self, basis_index: int, dictionary: Dictionary) -> None:
        """Refuse a set that leaves directions of the dictionary open.

        Raises
        ------
        DataError
            With the reason and the remedy.
        """
        if self.samples == 0:
            raise DataError(
                f"basis input {basis_index}: no samples; record more segments with "
                "`klab calibrate --segments N`"
            )
        if self.rank < self.observables:
            raise DataError(
                f"basis input {basis_index}: {self.samples} samples from {self.segments} "
                f"segments span only {self.rank} of the {self.observables} observables of "
                f"{dictionary.name}; segments under one constant input lie on few curves, so "
                "record more of them, from other states (`klab calibrate --segments N`), or "
                "choose a smaller dictionary"
            )


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

"""What a fit needs to know of its samples, however many: a triangular factor.

The lifted samples Psi_X (d, M), their successors Psi_Y and, for some estimators, instruments Psi_Z
stand side by side; [Psi_Z | Psi_X | Psi_Y] = Q R with orthogonal Q, so R (at most 3M rows) holds
all their inner products without squaring the condition. Factors of parts put on top of each other
have the factor of the whole: samples may come in any number of batches, from any number of logs.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
BATCH = 512
"""Rows that are taken in at once; bounds the memory, not the result. So many fit into the cache."""


class Moments:
    """The triangular factor of samples under one basis input.

    Parameters
    ----------
    observables
        Number M of the dictionary.
    instruments
        Whether the samples come with instruments.
    """

    def __init__(self, observables: int, *, instruments: bool = False) -> None:
        self.observables = observables
        self.instruments = instruments
        self.samples = 0
        self.segments = 0
        self._r = np.zeros((0, (3 if instruments else 2) * observables))

    def add(self, *parts: Array, segments: int) -> None:
        """Take in samples from so many further segments.

        Parameters
        ----------
        parts
            Instruments (d, M) if there are any, lifted states (d, M), lifted successors (d, M).
        segments
            How many the samples are from, none of them seen before.
        """
        count = len(parts[0])
        for start in range(0, count, BATCH):
            rows = np.hstack([part[start : start + BATCH] for part in parts])
            self._r = np.asarray(np.linalg.qr(np.vstack([self._r, rows]), mode="r"))
        self.samples += count
        self.segments += segments

    @property
    def x(self) -> Array:
        """Return R_x (k, M) with R_x^T R_x = Psi_X^T Psi_X."""
        start = self.observables if self.instruments else 0
        return self._r[:, start : start + self.observables]

    @property
    def y(self) -> Array:
        """Return R_y (k, M), of the successors."""
        return self._r[:, -self.observables :]

    @property
    def leading_x(self) -> Array:
        """Return the part of R_x (at most M rows) that the instruments span, or else all of it."""
        return self.x[: self.observables]

    @property
    def leading_y(self) -> Array:
        """Return the part of R_y (at most M rows) that the instruments span, or else the states."""
        return self.y[: self.observables]

    @property
    def scale(self) -> Array:
        """Return the root mean square of each observable (M,), one where it is always zero."""
        rms = np.sqrt(np.sum(self.x**2, axis=0) / max(self.samples, 1))
        return np.where(rms > 0.0, rms, 1.0)

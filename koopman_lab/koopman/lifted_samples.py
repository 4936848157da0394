"""Lifted samples of a data set, with the instruments that an estimator needs.

Noise in the regressors. Least squares takes the states for exact. Noise of the cameras, magnified
by the differences that make velocities, sits in Psi_X and in Psi_Y but is not carried over a step,
so M_0[omega, omega] comes out too small, and the error compounds over a horizon. A longer smoothing
window makes the noise smaller; it stays a bias that no amount of data takes away.

Instrumental variables take it away: with a Psi_Z that goes with the true states but not with the
noise of Psi_X and Psi_Y, Psi_Z^T Psi_Y = Psi_Z^T Psi_X M^T + (a mean of zero), which determines M.
Psi_Z is the dictionary at an earlier sample of the same run, so much earlier that no frame of the
cameras enters both: the velocity at a frame uses the window around it and a frame more at either
end. The cameras' noise is independent from frame to frame, so it is then independent in Psi_Z,
too. What remains is of second order in the noise: the mean of cos(theta + noise) is a little short
of cos(theta), in Psi_X and Psi_Y alike. What the motors did in between (they follow the command
late, and never quite) is motion, not noise, and Psi_Z knows it. The price is the first part of
each run, and a variance that grows where earlier samples say little of later ones; the smallest
canonical correlation of the two is reported.
"""

from __future__ import annotations

from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from koopman_lab.data.dataset import DataSet
from koopman_lab.data.processing import margin
from koopman_lab.data.source import window_of
from koopman_lab.data.time_shift import shifted_pairs
from koopman_lab.errors import DataError
from koopman_lab.koopman.dictionary import Dictionary
from koopman_lab.koopman.finite_observables import lifted, require_numbers, usable
from koopman_lab.koopman.moments import Moments
from koopman_lab.units import US_PER_S

Array = NDArray[np.float64]
Estimator = Literal["plain", "iv"]


class Samples(NamedTuple):
    """Under one basis input: lifted states and successors (d, M), and the run of each (d,).

    ``parts`` begins with the instruments (d, M) where there are any.
    """

    parts: tuple[Array, ...]
    segments: NDArray[np.int64]

    def select(self, rows: NDArray[np.intp]) -> Samples:
        """Return these rows."""
        return Samples(tuple(part[rows] for part in self.parts), self.segments[rows])


def lifted_samples(
    dataset: DataSet, index: int, dictionary: Dictionary, estimator: Estimator = "plain"
) -> Samples:
    """Return the lifted samples under a basis input.

    Raises
    ------
    DataError
        If an observable is no number for a sample, or the data do not say what instruments need to
        know of them.
    """
    X, Y, segments = dataset.X[index], dataset.Y[index], dataset.segments[index]
    psi_x, psi_y = lifted(dictionary, X), lifted(dictionary, Y)
    if not (usable(psi_x).all() and usable(psi_y).all()):
        require_numbers(dictionary, dataset)
    if estimator == "plain":
        return Samples((psi_x, psi_y), segments)
    earlier, later = shifted_pairs(dataset, index, lag_us(dataset))
    if len(X) and not len(later):
        raise DataError(
            f"basis input {index}: estimator iv needs samples {lag_us(dataset) / US_PER_S:.3f} s "
            "apart in one run, and no run is so long; record longer segments, take a smaller "
            "window, or use --estimator plain"
        )
    parts = (dictionary.lift(X[earlier]), dictionary.lift(X[later]), dictionary.lift(Y[later]))
    return Samples(parts, segments[later])


def lag_us(dataset: DataSet) -> int:
    """Return how much earlier an instrument is, in us: no frame enters both.

    Raises
    ------
    DataError
        If the data set does not say its window and frame rate, or no times.
    """
    rate_hz, window = dataset.metadata.get("frame_rate_hz"), window_of(dataset)
    timed = any(np.ptp(times) > 0 for times in dataset.start_us.values() if len(times))
    if rate_hz is None or window is None or not timed:
        raise DataError(
            "estimator iv needs the time of each sample, the frame rate and the window, and this "
            "data set does not say them; train from a session, or use --estimator plain"
        )
    # A pose is a frame; velocities take in margin + 1 to either side.
    reach = margin(window) + 1 if dataset.robot.speeds_at else 0
    return round((2 * reach + 1) * US_PER_S / float(rate_hz))


def add_samples(moments: Moments, samples: Samples) -> None:
    """Take the samples into the moments."""
    moments.add(*samples.parts, segments=len(np.unique(samples.segments)))

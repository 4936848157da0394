"""Which pairs of a data set are a given time apart."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from koopman_lab.data.dataset import DataSet
from koopman_lab.units import US_PER_S

LARGEST_TIME_ERROR = 0.01
"""How far apart times may be, in sampling times, and count as the same."""


def shifted_pairs(
    dataset: DataSet, index: int, ahead_us: int
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return pairs (k,) and, for each, the pair (k,) of the same run that begins so much later.

    Pairs without such a one are left out.

    Parameters
    ----------
    dataset
        Pairs in any order.
    index
        Index of the basis input.
    ahead_us
        How much later, in us.
    """
    times = dataset.start_us[index]
    if not len(times):
        return np.zeros(0, np.intp), np.zeros(0, np.intp)
    # One number line for all runs, so far apart that none reaches into the next.
    apart_us = 2 * (int(np.ptp(times)) + ahead_us + 1)
    _, runs = np.unique(dataset.segments[index], return_inverse=True)
    keys = runs * apart_us + (times - times.min())
    order = np.argsort(keys, kind="stable")
    targets = keys + ahead_us
    after = np.searchsorted(keys, targets, sorter=order)
    later = order[np.minimum(after, len(order) - 1)]
    earlier = order[np.maximum(after - 1, 0)]
    nearer = np.abs(keys[earlier] - targets) < np.abs(keys[later] - targets)
    ends = np.where(nearer, earlier, later)
    allowed_us = LARGEST_TIME_ERROR * dataset.dt_s * US_PER_S
    starts = np.flatnonzero(np.abs(keys[ends] - targets) <= allowed_us)
    return starts, ends[starts]

"""Which stamps of a recorded stream can be those of its clock; the others are left out of it.

Neither the time nor the order of arrival is data, so stamps are held against each other alone. A
few that lie an hour ahead of all others, or a day behind, were damaged or sent by somebody else:
they would stretch every time axis, and so few tell nothing by themselves. A clock that was set, or
a session that was resumed, has more of them; those stay.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from koopman_lab.bus.stamp_gate import NO_CLOCK_US
from koopman_lab.units import US_PER_S

ASTRAY_US = 60 * US_PER_S
"""A longer step between two stamps is a pause, a clock that was set, or a stamp that is wrong."""
FEW = 4
"""So many stamps between two such steps say nothing."""
MOST_SHARE = 0.01
"""Of all stamps, that may be left out so; of more nobody knows which are right."""


def plausible(utime_us: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Return of each stamp (N,) of one stream, in any order, whether it can be used."""
    possible: NDArray[np.bool_] = (utime_us >= -NO_CLOCK_US) & (utime_us <= NO_CLOCK_US)
    kept = np.flatnonzero(possible)
    if len(kept) < FEW / MOST_SHARE:
        return possible
    order = kept[np.argsort(utime_us[kept], kind="stable")]
    steps = np.diff(utime_us[order]) > ASTRAY_US
    if not steps.any():
        return possible
    group = np.concatenate([[0], np.cumsum(steps)])
    sizes = np.bincount(group)
    astray = order[sizes[group] <= FEW]
    if len(astray) <= MOST_SHARE * len(kept):
        possible[astray] = False
    return possible

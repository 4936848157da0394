"""How measured displacements in the plane follow from those that something else calls for.

A frame that is turned or scaled multiplies a displacement by a complex number; one that is mirrored
takes its conjugate first. So z = a z* + b conj(z*), least squares over many, tells which of both it
is: a = 1 and b = 0 where measured and called for agree; a = -1 where the robot's axis is taken
backwards; a = i for a quarter turn; b = 1 where x2 (or the heading) is counted the other way;
b = i where x1 and x2 are exchanged.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Complex = NDArray[np.complex128]
Array = NDArray[np.float64]

ALONG_ONE_LINE = 0.98
"""Displacements that are so much along one line tell nothing of a mirror image of them."""


class DisplacementFit(NamedTuple):
    """What displacements are, as a multiple of those called for.

    ``kept`` is the factor a of those, ``mirrored`` the factor b of their conjugates, 0 where all of
    them lie along one line; both are 0 where nothing moves.
    """

    kept: complex
    mirrored: complex


def fit_displacements(measured: Complex, called_for: Complex) -> DisplacementFit:
    """Fit measured displacements (N,) to those called for (N,), both x1 + i x2 in m."""
    power = float(np.sum(np.abs(called_for) ** 2))
    if not power:
        return DisplacementFit(0.0, 0.0)
    squared = complex(np.sum(called_for**2))
    kept = complex(np.vdot(called_for, measured))
    if abs(squared) > ALONG_ONE_LINE * power:
        return DisplacementFit(kept / power, 0.0)
    turned = complex(np.sum(called_for * measured))
    normal = np.array([[power, np.conj(squared)], [squared, power]])
    a, b = np.linalg.solve(normal, np.array([kept, turned]))
    return DisplacementFit(complex(a), complex(b))


def gain(measured: Array, called_for: Array) -> float | None:
    """Return measured numbers (N,) as a multiple of those called for; None if those are all 0."""
    power = float(called_for @ called_for)
    return float(called_for @ measured) / power if power else None

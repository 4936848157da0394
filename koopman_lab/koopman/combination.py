"""How matrices of the basis inputs make the matrix of an input.

The paper's formula (section 2.2) is affine in the input: M_u = M_0 + sum_i lambda_i (M_i - M_0).
The nonholonomic constraint is not. Where both basis inputs drive forward, as those of the
kinematic robot do, turning on the spot is their difference, and what is of second order in dt in
either of them, v omega dt^2 / 2 to the side, does not cancel.

The generators L_i of M_i = expm(dt L_i) do add up in control-affine systems:
L_u = L_0 + sum_i lambda_i (L_i - L_0), M_u = expm(dt L_u). For a dictionary that the robot leaves
invariant, such as D5t, this is exact for every input.
"""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from koopman_lab.errors import ModelError

Array = NDArray[np.float64]
Combination = Literal["paper", "generator"]
PAPER: Combination = "paper"

INTERVALS = 2
ORDER = 14
"""Order of the Taylor polynomial in each of the intervals.

The remainder is (norm / INTERVALS)^15 / 15! for each of them: below 2e-12 up to a norm of dt L_u
of 2, below 1e-16 up to 1. Robots of the lab have a norm of about 0.1 (dt omega).
"""
LARGEST_ERROR = 1e-9
"""Largest relative error of expm(logm(M)) of an M that has a usable logarithm."""


def generators(matrices: Array) -> Array:
    """Return dt times the generators (m + 1, M, M): the real principal logarithms of the matrices.

    Raises
    ------
    ModelError
        If a matrix has none.
    """
    from scipy.linalg import expm, logm

    logarithms = []
    for index, matrix in enumerate(matrices):
        values = np.linalg.eigvals(matrix)
        cut = values[(values.real <= 0.0) & (np.abs(values.imag) < 1e-12)]
        if len(cut):
            raise ModelError(
                f"M_{index} has the eigenvalue {cut.real.min():.3g}: no real generator leads to "
                "it; combine the matrices as the paper does (--combination paper), or train with "
                "more data"
            )
        logarithm = np.asarray(logm(matrix)).real
        error = np.abs(expm(logarithm) - matrix).max() / np.abs(matrix).max()
        if not error < LARGEST_ERROR:
            raise ModelError(
                f"M_{index}: its generator gives it back only to {error:.1g}; combine the "
                "matrices as the paper does (--combination paper)"
            )
        logarithms.append(logarithm)
    return np.array(logarithms)


def exponential_action(matrix: Any, psi: Any) -> Any:
    """Return expm(matrix) psi for symbols of CasADi (M, M) and (M,), with smooth derivatives.

    The polynomial is applied to the vector, which takes products of matrix and vector only and
    no decision that depends on numbers.
    """
    for _ in range(INTERVALS):
        term = psi
        for power in range(1, ORDER + 1):
            term = (matrix @ term) / (INTERVALS * power)
            psi = psi + term
    return psi

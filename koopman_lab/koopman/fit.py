"""Extended dynamic mode decomposition for one constant input (paper, section 2.2)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular

from koopman_lab.koopman.excitation import column_scale

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Fit:
    """A matrix M with psi+ = M psi.

    The paper's K = inv(C) A is the transpose of M. Row 0 belongs to the constant observable and
    is exactly [1, 0, ...]; ``constant_residual`` says how far least squares was from that.
    """

    matrix: Array
    constant_residual: float
    residual_rms: Array


def fit_matrix(psi_x: Array, psi_y: Array) -> Fit:
    """Fit M by least squares over the samples ``psi_x`` (d, M) and successors ``psi_y`` (d, M).

    Solved by QR of the column-scaled samples, which does not square their condition as the
    normal equations of the paper's formula would. The samples must have full column rank.
    """
    scale = column_scale(psi_x)
    q, r = np.linalg.qr(psi_x / scale)
    solution = solve_triangular(r, q.T @ psi_y) / scale[:, None]
    constant = np.zeros(psi_x.shape[1])
    constant[0] = 1.0
    residual = float(np.abs(solution[:, 0] - constant).max())
    solution[:, 0] = constant
    errors = psi_y - psi_x @ solution
    return Fit(solution.T.copy(), residual, np.sqrt(np.mean(errors**2, axis=0)))

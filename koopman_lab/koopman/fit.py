"""Extended dynamic mode decomposition for one constant input (paper, section 2.2)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from koopman_lab.errors import DataError
from koopman_lab.koopman.excitation import SMALLEST_SHARE
from koopman_lab.koopman.moments import Moments

Array = NDArray[np.float64]
WEAKEST_INSTRUMENT = 0.01
"""Canonical correlations below this leave a direction to chance: two in a hundred thousand samples
that have nothing to do with each other come to about 0.005."""

ROUNDING = 1e-12
"""Changes below this share of an observable are none."""

SMALLEST_RIDGE = 1e-20
"""Below it a pull is lost in rounding: it weighs the square root of this, beside samples of one."""


@dataclass(frozen=True)
class Fit:
    """A matrix M with psi+ = M psi.

    The paper's K = inv(C) A is the transpose of M. Row 0 belongs to the constant observable and
    is exactly [1, 0, ...]; ``constant_residual`` says how far least squares was from that.
    ``weakest_instrument`` is the smallest canonical correlation of instruments and samples, None
    without instruments and where M has fewer free numbers than the samples could tell.
    """

    matrix: Array
    constant_residual: float
    residual_rms: Array
    weakest_instrument: float | None = None


def regularises(ridge: float) -> bool:
    """Return whether a ridge determines what the samples leave open."""
    return ridge >= SMALLEST_RIDGE


def fit_moments(moments: Moments, *, ridge: float = 0.0, basis: Array | None = None) -> Fit:
    """Fit M by least squares, or by instrumental variables where the samples have instruments.

    Solved by the singular values of the column-scaled triangular factor, which does not square
    their condition as the normal equations of the paper's formula would.

    Parameters
    ----------
    moments
        Moments of the samples, which must excite the dictionary where no ridge regularises.
    ridge
        Weight of a Tikhonov term, relative to the mean square of each observable: pulls M towards
        the identity, never the coefficients of the constant, which carry the effect of the input.
    basis
        Matrices (K, M, M): M - I is to be a combination of them.

    Raises
    ------
    DataError
        If instruments are too weak, or the samples leave combinations of ``basis`` open.
    """
    size = moments.observables
    weakest = _weakest_instrument(moments) if basis is None else None
    scale = moments.scale
    a = moments.leading_x / scale
    b = moments.leading_y - moments.leading_x
    pull = np.sqrt(ridge * moments.samples) * np.eye(size)[1:]
    if basis is None:
        change = np.linalg.lstsq(np.vstack([a, pull]), np.vstack([b, 0.0 * pull]), rcond=None)[0]
    else:
        a, b = np.vstack([a, pull]), np.vstack([b, 0.0 * pull])
        change = _in_subspace(a, b, scale, basis, determined=regularises(ridge))
    M = np.eye(size) + (change / scale[:, None]).T
    constant = np.eye(size)[0]
    residual = float(np.abs(M[0] - constant).max())
    M[0] = constant
    errors = moments.y - moments.x @ M.T
    rms = np.sqrt(np.sum(errors**2, axis=0) / moments.samples)
    return Fit(M, residual, rms, weakest)


def fit_matrix(psi_x: Array, psi_y: Array) -> Fit:
    """Fit M by least squares over the samples ``psi_x`` (d, M) and successors ``psi_y`` (d, M)."""
    moments = Moments(psi_x.shape[1])
    moments.add(psi_x, psi_y, segments=1)
    return fit_moments(moments)


def _in_subspace(a: Array, b: Array, scale: Array, basis: Array, *, determined: bool) -> Array:
    """Return the scaled change (M, M) with a change = b, of combinations of ``basis``.

    The observables share unknowns here, so their errors are weighed: by the root mean square of
    what each changes in a step. Where that is rounding, as for the constant, it says nothing.
    """
    changes = np.linalg.norm(b, axis=0) / np.linalg.norm(a[:, 0])
    weight = 1.0 / np.where(changes > ROUNDING * scale, changes, scale)
    directions = scale[:, None] * basis.transpose(0, 2, 1)
    design = np.einsum("ij,kjl->ilk", a, directions) * weight[None, :, None]
    flat = design.reshape(-1, len(basis))
    norms = np.linalg.norm(flat, axis=0)
    norms = np.where(norms > 0.0, norms, 1.0)
    values = np.linalg.svd(flat / norms, compute_uv=False)
    rank = int(np.sum(values > SMALLEST_SHARE * values[0]))
    if rank < len(basis) and not determined:
        raise DataError(
            f"the samples determine only {rank} of the {len(basis)} numbers that a symmetric "
            "model leaves free; record more segments (`klab calibrate --segments N`), or "
            "regularise the fit (--ridge 1e-4)"
        )
    solution = np.linalg.lstsq(flat / norms, (b * weight).ravel(), rcond=None)[0] / norms
    return np.asarray(np.tensordot(solution, directions, axes=1))


def _weakest_instrument(moments: Moments) -> float | None:
    if not moments.instruments:
        return None
    r = np.asarray(np.linalg.qr(moments.x / moments.scale, mode="r"))
    values = np.linalg.svd(
        np.linalg.solve(r.T, (moments.leading_x / moments.scale).T), compute_uv=False
    )
    weakest = float(values[-1])
    if weakest < WEAKEST_INSTRUMENT:
        raise DataError(
            f"estimator iv: earlier samples say too little of later ones (weakest canonical "
            f"correlation {weakest:.1g}, {WEAKEST_INSTRUMENT:g} needed); record more segments, "
            "take a smaller window, or use --estimator plain"
        )
    return weakest

"""The matrices of all basis inputs, each fitted to the samples taken under its own input."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from koopman_lab.errors import DataError
from koopman_lab.koopman.dictionary import Dictionary
from koopman_lab.koopman.excitation import excitation
from koopman_lab.koopman.fit import Fit, fit_moments, regularises
from koopman_lab.koopman.lifted_samples import Samples, add_samples
from koopman_lab.koopman.moments import Moments
from koopman_lab.koopman.symmetry import equivariant_basis
from koopman_lab.koopman.training_report import BasisReport, Method

Array = NDArray[np.float64]


def fit_all(
    dictionary: Dictionary,
    basis_inputs: Mapping[int, Sequence[float]],
    moments: Mapping[int, Moments],
    method: Method,
) -> tuple[Array, Array, list[BasisReport]]:
    """Return M_i (m + 1, M, M), u_i (m + 1, m), and what was learned for each.

    Raises
    ------
    DataError, ModelError
        As :func:`fit_basis`.
    """
    inputs = {0: (0.0,) * dictionary.robot.input_dim} | {
        i: tuple(map(float, u)) for i, u in basis_inputs.items()
    }
    matrices, reports = [], []
    for index, u in sorted(inputs.items()):
        if index not in moments:
            # Only u_0 of a robot without drift can be missing.
            matrices.append(np.eye(dictionary.size))
            reports.append(BasisReport(index, u, None, 0.0, {}))
            continue
        fit = fit_basis(moments[index], index, dictionary, method)
        matrices.append(fit.matrix)
        rms = dict(zip(dictionary.names, fit.residual_rms.tolist(), strict=True))
        basis_excitation = excitation(moments[index])
        reports.append(
            BasisReport(
                index, u, basis_excitation, fit.constant_residual, rms, fit.weakest_instrument
            )
        )
    return np.array(matrices), np.array([u for _, u in sorted(inputs.items())]), reports


def fit_basis(moments: Moments, index: int, dictionary: Dictionary, method: Method) -> Fit:
    """Fit the matrix of one basis input.

    Raises
    ------
    DataError
        If the samples do not excite what is to be fitted.
    ModelError
        If the dictionary cannot be symmetric.
    """
    spans = excitation(moments)
    try:
        spans.require_samples()
        if method.symmetric:
            basis = equivariant_basis(dictionary)
            return fit_moments(moments, ridge=method.ridge, basis=basis)
        # The pull determines what samples leave open, but no instrument where there is none.
        if not regularises(method.ridge) or moments.instruments:
            spans.require_full_rank(dictionary)
        return fit_moments(moments, ridge=method.ridge)
    except DataError as error:
        raise DataError(f"basis input {index}: {error}") from None


def moments_of(dictionary: Dictionary, samples: Samples) -> Moments:
    """Return the moments of samples."""
    moments = Moments(dictionary.size, instruments=len(samples.parts) == 3)
    add_samples(moments, samples)
    return moments

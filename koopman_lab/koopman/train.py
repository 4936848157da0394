"""From a data set to a model, with a report of what the data could and could not say."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from importlib.metadata import version
from typing import Any

import numpy as np

from koopman_lab.data.dataset import DataSet
from koopman_lab.errors import DataError
from koopman_lab.koopman.combination import PAPER, Combination
from koopman_lab.koopman.dictionary import dictionary
from koopman_lab.koopman.excitation import Excitation, excitation
from koopman_lab.koopman.fit import fit_matrix
from koopman_lab.koopman.model import BilinearModel


@dataclass(frozen=True)
class BasisReport:
    """What was learned for one basis input; ``None`` where the matrix follows from theory."""

    basis_index: int
    basis_input: tuple[float, float]
    excitation: Excitation | None
    constant_residual: float
    residual_rms: dict[str, float]


@dataclass(frozen=True)
class TrainingReport:
    """Everything ``klab train`` prints."""

    robot: str
    dictionary: str
    dt_s: float
    data_hash: str
    bases: tuple[BasisReport, ...]

    def as_dict(self) -> dict[str, Any]:
        """Return the report as JSON can hold it."""
        return asdict(self)


def train(
    dataset: DataSet, dictionary_name: str, combination: Combination = PAPER
) -> tuple[BilinearModel, TrainingReport]:
    """Fit the matrices of all basis inputs.

    A driftless robot at rest stays at rest, so a data set of the kinematic robot without samples
    of u_0 has M_0 = I exactly. The result depends on nothing but the data, to the last bit.

    Raises
    ------
    ModelError
        If there is no such dictionary for the robot.
    DataError
        If the samples of a basis input do not excite the dictionary.
    """
    observables = dictionary(dictionary_name, dataset.robot_kind)
    if dataset.robot_kind == "dynamic" and 0 not in dataset.basis_inputs:
        raise DataError(
            "data set of the dynamic robot without basis input u_0: its drift cannot be learned; "
            "record a session with three sampler.basis_inputs"
        )
    inputs = {0: np.zeros(2)} | {i: np.asarray(u, float) for i, u in dataset.basis_inputs.items()}
    lifted = {index: observables.lift(x) for index, x in dataset.X.items()}
    found = {index: excitation(psi, dataset.segments[index]) for index, psi in lifted.items()}
    for index, excited in found.items():
        excited.require_full_rank(index, observables)
    matrices, reports = [], []
    for index in sorted(inputs):
        u = (float(inputs[index][0]), float(inputs[index][1]))
        if index not in lifted:
            # Only u_0 of the kinematic robot can be missing: it has no drift.
            matrices.append(np.eye(observables.size))
            reports.append(BasisReport(index, u, None, 0.0, {}))
            continue
        fit = fit_matrix(lifted[index], observables.lift(dataset.Y[index]))
        matrices.append(fit.matrix)
        residuals = dict(zip(observables.names, fit.residual_rms.tolist(), strict=True))
        reports.append(BasisReport(index, u, found[index], fit.constant_residual, residuals))
    report = TrainingReport(
        dataset.robot_kind, observables.name, dataset.dt_s, dataset.data_hash, tuple(reports)
    )
    metadata = {
        "training": report.as_dict(),
        "data": dict(dataset.metadata),
        "versions": {name: version(name) for name in ("koopman-lab", "numpy", "scipy")},
    }
    basis_inputs = np.array([inputs[i] for i in sorted(inputs)])
    model = BilinearModel(
        observables, np.array(matrices), basis_inputs, dataset.dt_s, metadata, combination
    )
    return model, report

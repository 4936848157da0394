"""From data sets to a model, with a report of what the data could and could not say."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from datetime import datetime, timezone
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from koopman_lab.data.dataset import DataSet
from koopman_lab.data.source import window_of
from koopman_lab.errors import DataError
from koopman_lab.koopman.bilinear_model import BilinearModel
from koopman_lab.koopman.combination import PAPER, Combination
from koopman_lab.koopman.defects import Defects, defects
from koopman_lab.koopman.dictionary import Dictionary, dictionary
from koopman_lab.koopman.excitation import Excitation, excitation
from koopman_lab.koopman.fit import Fit, fit_moments
from koopman_lab.koopman.moments import Moments
from koopman_lab.koopman.samples import Estimator, Samples, add_samples, samples
from koopman_lab.koopman.symmetry import equivariant_basis
from koopman_lab.units import US_PER_S

Array = NDArray[np.float64]
INPUTS = "basis inputs"


@dataclass(frozen=True)
class Method:
    """How a model is fitted.

    Attributes
    ----------
    estimator
        Least squares, or instrumental variables (:mod:`koopman_lab.koopman.samples`).
    ridge
        Weight of a pull towards the identity (:func:`koopman_lab.koopman.fit.fit_moments`).
    symmetric
        Whether only models that commute with planar motions are fitted
        (:mod:`koopman_lab.koopman.symmetry`).
    combination
        Of the inputs (:mod:`koopman_lab.koopman.combination`).
    """

    estimator: Estimator = "plain"
    ridge: float = 0.0
    symmetric: bool = False
    combination: Combination = PAPER


@dataclass(frozen=True)
class BasisReport:
    """What was learned for one basis input; ``None`` where the matrix follows from theory.

    ``weakest_instrument`` is None without instruments.
    """

    basis_index: int
    basis_input: tuple[float, ...]
    excitation: Excitation | None
    constant_residual: float
    residual_rms: dict[str, float]
    weakest_instrument: float | None = None


@dataclass(frozen=True)
class TrainingReport:
    """Everything ``klab train`` prints; ``defects`` is None for robots without a turn in place."""

    robot: str
    dictionary: str
    dt_s: float
    window: int | None
    method: Method
    data_hash: str
    bases: tuple[BasisReport, ...]
    defects: Defects | None

    def as_dict(self) -> dict[str, Any]:
        """Return the report as JSON can hold it."""
        return asdict(self)


class Trainer:
    """Takes in data sets one after the other and fits a model to all of them.

    It keeps no samples, so its memory does not grow with their number. Of how the data were made
    the model's metadata hold what the first data set says (``data``), and of each which data and
    when (``sources``).

    Parameters
    ----------
    observables
        A dictionary, or the name of one.
    method
        How to fit.
    """

    def __init__(self, observables: str | Dictionary, method: Method | None = None) -> None:
        self._wanted = observables
        self._method = method or Method()
        self._first: dict[str, Any] | None = None
        self._dictionary: Dictionary | None = None
        self._moments: dict[int, Moments] = {}
        self._made: dict[str, Any] = {}
        self._sources: list[dict[str, Any]] = []

    def add(self, dataset: DataSet) -> None:
        """Take in a data set.

        Raises
        ------
        ModelError
            If there is no such dictionary for the robot.
        DataError
            If the data set was taken with other inputs, sampling time, window or robot than the
            first one, is one taken in before, or does not say what the estimator needs.
        """
        own = self._begin(dataset)
        data_hash = dataset.data_hash
        if any(source["data_hash"] == data_hash for source in self._sources):
            raise DataError(
                "the same data were given twice and would count twice; name each session once"
            )
        for index in dataset.X:
            add_samples(self._moments[index], samples(dataset, index, own, self._method.estimator))
        self._made = self._made or _without_place(dataset.metadata)
        starts = [times.min() for times in dataset.start_us.values() if len(times)]
        began = min(starts, default=0) / US_PER_S
        self._sources.append(
            {
                "data_hash": data_hash,
                "pairs": {str(index): len(x) for index, x in sorted(dataset.X.items())},
                "recorded_utc": datetime.fromtimestamp(began, timezone.utc).isoformat()
                if began
                else None,
            }
        )

    def result(self) -> tuple[BilinearModel, TrainingReport]:
        """Fit the matrices of all basis inputs.

        Raises
        ------
        DataError
            If there are no data, or those of a basis input do not excite the dictionary.
        ModelError
            If the dictionary cannot be symmetric, or the generators cannot be combined.
        """
        first, own = self._first, self._dictionary
        if first is None or own is None:
            raise DataError("no data set to train with; record one with `klab calibrate`")
        matrices, basis_inputs, reports = fit_all(own, first[INPUTS], self._moments, self._method)
        model = BilinearModel(
            own, matrices, basis_inputs, first["dt_s"], {}, self._method.combination
        )
        report = TrainingReport(
            robot=first["robot"],
            dictionary=own.name,
            dt_s=first["dt_s"],
            window=first["window"],
            method=self._method,
            data_hash=self._data_hash(),
            bases=tuple(reports),
            defects=defects(model),
        )
        metadata = {
            "training": report.as_dict(),
            "data": self._made,
            "sources": self._sources,
            "versions": {name: version(name) for name in ("koopman-lab", "numpy", "scipy")},
        }
        return replace(model, metadata=metadata), report

    def _begin(self, dataset: DataSet) -> Dictionary:
        if self._first is None or self._dictionary is None:
            self._dictionary = resolve(self._wanted, dataset)
            instruments = self._method.estimator == "iv"
            self._moments = {
                index: Moments(self._dictionary.size, instruments=instruments)
                for index in dataset.basis_inputs
            }
            self._first = _facts(dataset)
        other = _facts(dataset)
        for name, value in self._first.items():
            if other[name] != value:
                raise DataError(
                    f"data sets do not fit together: {name} is {value} in the first, {other[name]} "
                    "in another one; train from sessions of one robot and configuration (--dt and "
                    "--window process them alike)"
                )
        return self._dictionary

    def _data_hash(self) -> str:
        hashes = [str(source["data_hash"]) for source in self._sources]
        together = hashlib.sha256(" ".join(hashes).encode()).hexdigest()
        return hashes[0] if len(hashes) == 1 else together


def train(
    data: DataSet | Iterable[DataSet],
    observables: str | Dictionary,
    method: Method | None = None,
) -> tuple[BilinearModel, TrainingReport]:
    """Fit the matrices of all basis inputs to one data set or several.

    A driftless robot at rest stays at rest, so its data without samples of u_0 give exactly
    M_0 = I. The result depends on nothing but the data, to the last bit. Of several data sets one
    at a time is in memory if they come from a generator.

    Raises
    ------
    ModelError
        If there is no such dictionary for the robot, it cannot be symmetric, or the generators
        cannot be combined.
    DataError
        If the samples of a basis input do not excite the dictionary, or the data sets do not fit
        together.
    """
    trainer = Trainer(observables, method)
    for dataset in [data] if isinstance(data, DataSet) else data:
        trainer.add(dataset)
    return trainer.result()


def resolve(wanted: str | Dictionary, dataset: DataSet) -> Dictionary:
    """Return the dictionary for a data set.

    Raises
    ------
    ModelError
        If there is none of this name for the robot.
    DataError
        If the data set cannot give a model of it.
    """
    kind = dataset.robot_kind
    own = dictionary(wanted, kind) if isinstance(wanted, str) else wanted
    if own.kind != kind:
        raise DataError(
            f"dictionary {own.name} is for the {own.kind} robot, the data are of the {kind} one; "
            "choose another dictionary"
        )
    if dataset.robot.drifts and 0 not in dataset.basis_inputs:
        raise DataError(
            f"data set of the {kind} robot without basis input u_0: its drift cannot be learned; "
            f"record a session with {dataset.robot.input_dim + 1} sampler.basis_inputs"
        )
    return own


def fit_all(
    own: Dictionary,
    given: Mapping[int, Sequence[float]],
    moments: Mapping[int, Moments],
    method: Method,
) -> tuple[Array, Array, list[BasisReport]]:
    """Return M_i (m + 1, M, M), u_i (m + 1, m), and what was learned for each.

    Raises
    ------
    DataError, ModelError
        As :func:`fit_basis`.
    """
    inputs = {0: (0.0,) * own.robot.input_dim} | {i: tuple(map(float, u)) for i, u in given.items()}
    matrices, reports = [], []
    for index, u in sorted(inputs.items()):
        if index not in moments:
            # Only u_0 of a robot without drift can be missing.
            matrices.append(np.eye(own.size))
            reports.append(BasisReport(index, u, None, 0.0, {}))
            continue
        fit = fit_basis(moments[index], index, own, method)
        matrices.append(fit.matrix)
        rms = dict(zip(own.names, fit.residual_rms.tolist(), strict=True))
        found = excitation(moments[index])
        reports.append(
            BasisReport(index, u, found, fit.constant_residual, rms, fit.weakest_instrument)
        )
    return np.array(matrices), np.array([u for _, u in sorted(inputs.items())]), reports


def fit_basis(moments: Moments, index: int, own: Dictionary, method: Method) -> Fit:
    """Fit the matrix of one basis input.

    Raises
    ------
    DataError
        If the samples do not excite what is to be fitted.
    ModelError
        If the dictionary cannot be symmetric.
    """
    if method.symmetric:
        if not moments.samples:
            excitation(moments).require_full_rank(index, own)
        basis = equivariant_basis(own)
        try:
            return fit_moments(moments, ridge=method.ridge, basis=basis)
        except DataError as error:
            raise DataError(f"basis input {index}: {error}") from None
    excitation(moments).require_full_rank(index, own)
    return fit_moments(moments, ridge=method.ridge)


def moments_of(own: Dictionary, of: Samples) -> Moments:
    """Return the moments of samples."""
    moments = Moments(own.size, instruments=len(of.parts) == 3)
    add_samples(moments, of)
    return moments


def _without_place(metadata: Mapping[str, Any]) -> dict[str, Any]:
    """Return metadata with the name of the source only: a model must not hang on where it lay."""
    source = metadata.get("source")
    if not source:
        return dict(metadata)
    return dict(metadata) | {"source": dict(source) | {"file": Path(source["file"]).name}}


def _facts(dataset: DataSet) -> dict[str, Any]:
    return {
        "robot": dataset.robot_kind,
        "dt_s": dataset.dt_s,
        "window": window_of(dataset),
        "processing": dataset.metadata.get("processing"),
        INPUTS: {i: tuple(u.tolist()) for i, u in sorted(dataset.basis_inputs.items())},
    }

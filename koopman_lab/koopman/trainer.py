"""From data sets to a model, with a report of what the data could and could not say."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping
from dataclasses import replace
from datetime import datetime, timezone
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from koopman_lab.data.dataset import DataSet
from koopman_lab.data.source import geometry_of, window_of
from koopman_lab.errors import DataError
from koopman_lab.koopman.basis_fit import fit_all
from koopman_lab.koopman.bilinear_model import BilinearModel
from koopman_lab.koopman.defects import defects
from koopman_lab.koopman.dictionary import Dictionary, dictionary
from koopman_lab.koopman.finite_observables import require_numbers_at_goal
from koopman_lab.koopman.lifted_samples import add_samples, lifted_samples
from koopman_lab.koopman.moments import Moments
from koopman_lab.koopman.training_report import Method, TrainingReport
from koopman_lab.units import US_PER_S

Array = NDArray[np.float64]
INPUTS = "basis inputs"

LAST_S = 253_402_300_800.0
"""Since 1970 begins the year 10000, which has no name; data of others may bear any time."""


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
        self._requested = observables
        self._method = method or Method()
        self._first: dict[str, Any] | None = None
        self._dictionary: Dictionary | None = None
        self._moments: dict[int, Moments] = {}
        self._data_metadata: dict[str, Any] = {}
        self._sources: list[dict[str, Any]] = []

    def add(self, dataset: DataSet) -> None:
        """Take in a data set.

        Raises
        ------
        ModelError
            If there is no such dictionary for the robot, or it is no number at the goal.
        DataError
            If an observable is no number for a sample, or the data set was taken with other
            inputs, sampling time, window or robot (kind or geometry) than the first one, is one
            taken in before, or does not say what the estimator needs.
        """
        observables = self._dictionary_for(dataset)
        data_hash = dataset.data_hash
        if any(source["data_hash"] == data_hash for source in self._sources):
            raise DataError(
                "the same data were given twice and would count twice; name each session once"
            )
        for index in dataset.X:
            add_samples(
                self._moments[index],
                lifted_samples(dataset, index, observables, self._method.estimator),
            )
        if not self._sources:
            require_numbers_at_goal(observables)
        self._data_metadata = self._data_metadata or _without_folder(dataset.metadata)
        starts = [times.min() for times in dataset.start_us.values() if len(times)]
        start_s = float(min(starts, default=0)) / US_PER_S
        self._sources.append(
            {
                "data_hash": data_hash,
                "pairs": {str(index): len(x) for index, x in sorted(dataset.X.items())},
                "recorded_utc": datetime.fromtimestamp(start_s, timezone.utc).isoformat()
                if 0.0 < start_s < LAST_S
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
        first, observables = self._first, self._dictionary
        if first is None or observables is None:
            raise DataError("no data set to train with; record one with `klab calibrate`")
        matrices, basis_inputs, reports = fit_all(
            observables, first[INPUTS], self._moments, self._method
        )
        model = BilinearModel(
            observables, matrices, basis_inputs, first["dt_s"], {}, self._method.combination
        )
        report = TrainingReport(
            robot=first["robot"],
            dictionary=observables.name,
            dt_s=first["dt_s"],
            window=first["window"],
            method=self._method,
            data_hash=self._data_hash(),
            bases=tuple(reports),
            defects=defects(model),
        )
        metadata = {
            "training": report.as_dict(),
            "data": self._data_metadata,
            "sources": self._sources,
            "versions": {name: version(name) for name in ("koopman-lab", "numpy", "scipy")},
        }
        return replace(model, metadata=metadata), report

    def _dictionary_for(self, dataset: DataSet) -> Dictionary:
        if self._first is None or self._dictionary is None:
            self._dictionary = resolve(self._requested, dataset)
            instruments = self._method.estimator == "iv"
            self._moments = {
                index: Moments(self._dictionary.size, instruments=instruments)
                for index in dataset.basis_inputs
            }
            self._first = _common_facts(dataset)
        other = _common_facts(dataset)
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


def resolve(requested: str | Dictionary, dataset: DataSet) -> Dictionary:
    """Return the dictionary for a data set.

    Raises
    ------
    ModelError
        If there is none of this name for the robot.
    DataError
        If the data set cannot give a model of it.
    """
    kind = dataset.robot_kind
    observables = dictionary(requested, kind) if isinstance(requested, str) else requested
    if observables.kind != kind:
        raise DataError(
            f"dictionary {observables.name} is for the {observables.kind} robot, the data are of "
            f"the {kind} one; choose another dictionary"
        )
    if dataset.robot.drifts and 0 not in dataset.basis_inputs:
        raise DataError(
            f"data set of the {kind} robot without basis input u_0: its drift cannot be learned; "
            f"record a session with {dataset.robot.input_dim + 1} sampler.basis_inputs"
        )
    return observables


def _without_folder(metadata: Mapping[str, Any]) -> dict[str, Any]:
    """Return metadata with the name of the source only: a model must not hang on where it lay."""
    source = metadata.get("source")
    if not source:
        return dict(metadata)
    return dict(metadata) | {"source": dict(source) | {"file": Path(source["file"]).name}}


def _common_facts(dataset: DataSet) -> dict[str, Any]:
    return {
        "robot": dataset.robot_kind,
        **geometry_of(dataset.metadata),
        "dt_s": dataset.dt_s,
        "window": window_of(dataset),
        "processing": dataset.metadata.get("processing"),
        INPUTS: {i: tuple(u.tolist()) for i, u in sorted(dataset.basis_inputs.items())},
    }

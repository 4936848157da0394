"""What a bilinear model's file holds, checked against the robots and dictionaries known here."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple, get_args

import numpy as np
from numpy.typing import NDArray

from koopman_lab.array_file import ArrayRow, checked_arrays
from koopman_lab.errors import LabError, ModelError
from koopman_lab.json_file import checked_table
from koopman_lab.koopman.combination import PAPER, Combination
from koopman_lab.koopman.dictionary import DICTIONARIES, Dictionary, dictionary, from_expressions
from koopman_lab.koopman.model_file import EDMD, ModelFile, ModelHeader
from koopman_lab.robots.table import robot_type

Array = NDArray[np.float64]


class BilinearHeader(ModelHeader):
    """What the header of a bilinear model's file says."""

    dictionary: str
    observables: list[str]
    expressions: list[str] | None = None
    combination: str = PAPER


class BilinearContent(NamedTuple):
    """The arguments of a :class:`~koopman_lab.koopman.bilinear_model.BilinearModel`."""

    dictionary: Dictionary
    matrices: Array
    basis_inputs: Array
    dt_s: float
    metadata: Mapping[str, Any]
    combination: Combination


def content_of(file: ModelFile) -> BilinearContent:
    """Return what a model file holds.

    Raises
    ------
    ModelError
        If it is another predictor's, lacks something, or is of a robot or a dictionary that is
        not known here.
    """
    path, header = file.path, file.header
    if header["predictor"] != EDMD:
        raise ModelError(f"{path}: a model of the predictor {header['predictor']!r}, not {EDMD}")
    checked_table(file.refusal, header, BilinearHeader)
    combination = header.get("combination", PAPER)
    try:
        robot_type(header["robot"])
    except LabError as error:
        raise ModelError(f"{path}: {error}") from None
    observables = _stated_dictionary(path, header)
    size = observables.size
    if list(observables.names) != header["observables"]:
        raise ModelError(
            f"{path}: its observables are not those of {observables.name} here; train it "
            "again from its session"
        )
    inputs = observables.robot.input_dim
    arrays = checked_arrays(
        file.refusal,
        file.arrays,
        [
            ArrayRow("matrices", "real", (inputs + 1, size, size)),
            ArrayRow("basis_inputs", "real", (inputs + 1, inputs)),
        ],
    )
    if combination not in get_args(Combination):
        raise ModelError(
            f"{path}: combination {combination!r} of inputs is not known here; expected "
            f"{' or '.join(get_args(Combination))}; train it again from its session"
        )
    dt_s, metadata = header["dt_s"], header["metadata"]
    return BilinearContent(
        observables,
        arrays["matrices"],
        arrays["basis_inputs"],
        dt_s,
        metadata,
        combination,
    )


def _stated_dictionary(path: Path, header: Mapping[str, Any]) -> Dictionary:
    """Return the dictionary that a file says: by its expressions, or one known by its name."""
    try:
        expressions = header.get("expressions")
        if expressions is not None and header["dictionary"] not in DICTIONARIES:
            return from_expressions(header["dictionary"], header["robot"], expressions)
        return dictionary(header["dictionary"], header["robot"])
    except ModelError as error:
        raise ModelError(
            f"{path}: {error}; a dictionary of your own that is a function must be registered "
            "before the model is read (koopman_lab.koopman.dictionary.register)"
        ) from None

"""The file of a learned model: one ``.npz`` without pickle, with a header of JSON.

The header says the format, the predictor whose model it is, the robot, the sampling time and where
the model comes from; whatever else it holds, and all arrays, are the predictor's own.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from numpy.typing import NDArray
from pydantic import ConfigDict

from koopman_lab.array_file import read_array_file, write_array_file
from koopman_lab.data.metadata import Metadata, SamplingTime
from koopman_lab.errors import ModelError
from koopman_lab.json_file import JsonTable, PartsOrNothing, Refusal, checked_table

FORMAT = 2
"""Version of the model file; raised when its meaning changes."""
READABLE = (1, 2)
"""Format 1 has no expressions and no combination, which was the paper's."""
EDMD = "edmd"
"""The predictor of files that say none."""


class StoredReason(JsonTable):
    """See :class:`koopman_lab.evaluation.plausibility.Reason`."""

    level: str
    text: str


class StoredVerdict(JsonTable):
    """See :class:`koopman_lab.evaluation.plausibility.Verdict`; its figures are free."""

    model_config = ConfigDict(allow_inf_nan=True)

    level: str
    reasons: list[StoredReason]


class Verdicts(JsonTable):
    """The verdicts that a model was trained with."""

    sources: Sequence[dict[str, StoredVerdict]] = ()


class ModelMetadata(PartsOrNothing):
    """What of the metadata of a model is read."""

    data: Metadata | None = None
    verdict: Verdicts | None = None


class ModelHeader(JsonTable):
    """What the header of a model file says, whatever the predictor."""

    format: int
    predictor: str
    robot: str
    dt_s: SamplingTime
    metadata: ModelMetadata


class ModelFile(NamedTuple):
    """What a file holds.

    Attributes
    ----------
    path
        Where the file is.
    header
        JSON with ``format``, ``predictor``, ``robot``, ``dt_s`` and ``metadata`` at least; those
        are of the types of :class:`ModelHeader`.
    arrays
        Arrays by name, those of real numbers finite.
    """

    path: Path
    header: dict[str, Any]
    arrays: dict[str, NDArray[Any]]

    @property
    def refusal(self) -> Refusal:
        """Return how it is refused where something in it is not as it should be."""
        return refusal_of(self.path)


def refusal_of(path: Path) -> Refusal:
    """Return how a file that is no model is refused."""
    return Refusal(path, "a model", "`klab train SESSION` makes one", ModelError)


def read_model_file(path: Path) -> ModelFile:
    """Read a model file of any predictor.

    Raises
    ------
    ModelError
        If the file is missing, damaged, no model, or of another version.
    """
    refusal = refusal_of(path)
    header, arrays = read_array_file(refusal)
    header = {"predictor": EDMD} | header
    version = header.get("format")
    if type(version) is int and version not in READABLE:
        raise ModelError(
            f"{path}: model file of format {version}, this version reads "
            f"{' and '.join(map(str, READABLE))}; train it again from its session"
        )
    checked_table(refusal, header, ModelHeader)
    return ModelFile(path, header, arrays)


def write_model_file(path: Path, header: Mapping[str, Any], arrays: Mapping[str, Any]) -> None:
    """Write a model file, whole or not at all.

    Parameters
    ----------
    path
        Where the file is.
    header
        JSON with ``predictor``, ``robot``, ``dt_s`` and ``metadata``.
    arrays
        Arrays by name.

    Raises
    ------
    DiskError
        If the file cannot be written.
    """
    write_array_file(path, {"format": FORMAT, **header}, arrays)

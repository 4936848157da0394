"""The file of a learned model: one ``.npz`` without pickle, with a header of JSON.

The header says the format, the predictor whose model it is, the robot, the sampling time and where
the model comes from; whatever else it holds, and all arrays, are the predictor's own.
"""

from __future__ import annotations

import json
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from koopman_lab.errors import ModelError
from koopman_lab.files import replacing

FORMAT = 2
"""Version of the model file; raised when its meaning changes."""
READABLE = (1, 2)
"""Format 1 has no expressions and no combination, which was the paper's."""
EDMD = "edmd"
"""The predictor of files that say none."""
REQUIRED = ("format", "robot", "dt_s", "metadata")


class ModelFile(NamedTuple):
    """What a file holds.

    Attributes
    ----------
    path
        Where the file is.
    header
        JSON with ``format``, ``predictor``, ``robot``, ``dt_s`` and ``metadata`` at least.
    arrays
        Arrays by name.
    """

    path: Path
    header: dict[str, Any]
    arrays: dict[str, NDArray[Any]]

    @property
    def damaged(self) -> ModelError:
        """Return what to raise where something is missing in it."""
        return damaged(self.path)


def damaged(path: Path) -> ModelError:
    """Return what to raise where a file is no model, or lacks something."""
    return ModelError(f"{path}: damaged, or not a model; `klab train SESSION` makes one")


def read_model_file(path: Path) -> ModelFile:
    """Read a model file of any predictor.

    Raises
    ------
    ModelError
        If the file is missing, damaged, no model, or of another version.
    """
    try:
        # Opened here: np.load leaves a file open that it cannot make sense of.
        with path.open("rb") as raw, np.load(raw, allow_pickle=False) as file:
            header = json.loads(bytes(file["header"]))
            arrays = {name: file[name] for name in file.files if name != "header"}
            version, *_ = (header[key] for key in REQUIRED)
    except FileNotFoundError:
        raise ModelError(f"{path}: no such model; `klab train SESSION` makes one") from None
    except (OSError, ValueError, TypeError, KeyError, EOFError, zipfile.BadZipFile):
        raise damaged(path) from None
    if version not in READABLE:
        raise ModelError(
            f"{path}: model file of format {version}, this version reads "
            f"{' and '.join(map(str, READABLE))}; train it again from its session"
        )
    return ModelFile(path, {"predictor": EDMD} | header, arrays)


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
    """
    text = json.dumps({"format": FORMAT, **header}, sort_keys=True).encode()
    with replacing(path) as file:
        np.savez(file, header=np.frombuffer(text, np.uint8), **arrays)

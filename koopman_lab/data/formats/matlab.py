"""One .mat file for MATLAB and Octave: a struct a channel, whose fields are the messages'."""

from __future__ import annotations

import re
from collections.abc import Container, Iterable
from pathlib import Path
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray
from scipy.io import savemat

from koopman_lab.data.formats.decoded import ARRIVAL, Column, Exported, columns_by_channel
from koopman_lab.eventlog.eventlog import Event
from koopman_lab.files import replacing

LONGEST_NAME = 63
"""Of a variable of MATLAB."""
_TYPES = {
    "int8_t": np.int8,
    "int16_t": np.int16,
    "int32_t": np.int32,
    "int64_t": np.int64,
    "byte": np.uint8,
    "boolean": np.bool_,
    "float": np.float32,
    "double": np.float64,
}


def write(events: Iterable[Event], path: Path) -> Exported:
    """Write one file of MATLAB's version 5, compressed, whole or not at all.

    Numbers of N messages are columns (N, 1), arrays rows of matrices (N, K), shorter ones with NaN
    behind (integers: 0), texts cells. ``arrival_us`` is when the logger received each message.

    Raises
    ------
    OSError
        If the file cannot be written.
    LogError
        If no message can be decoded.
    """
    written = Exported.nothing()
    variables: dict[str, dict[str, Any]] = {}
    for name, (arrivals, columns) in columns_by_channel(events, written).items():
        fields = {ARRIVAL: np.array(arrivals, np.int64)}
        variables[variable_name(name, variables)] = fields | {c.name: _array(c) for c in columns}
    with replacing(path) as file:
        savemat(
            cast(Any, file),  # which its stubs do not know
            variables,
            long_field_names=True,
            do_compression=True,
            oned_as="column",
        )
    return written


def variable_name(channel: str, taken: Container[str] = ()) -> str:
    """Return a name that MATLAB takes, for a channel whose name may be anybody's."""
    plain = re.sub(r"[^A-Za-z0-9_]", "_", channel)
    plain = plain if plain[:1].isalpha() else f"x{plain}"
    name, number = plain[:LONGEST_NAME], 1
    while name in taken:
        number += 1
        ending = f"_{number}"
        name = plain[: LONGEST_NAME - len(ending)] + ending
    return name


def _array(column: Column) -> Any:
    if column.kind not in _TYPES:
        cells = np.empty(len(column.values), object)
        for k, value in enumerate(column.values):
            cells[k] = str(value)
        return cells
    kind = _TYPES[column.kind]
    if not column.dimensions:
        return np.array(column.values, kind)
    rows: list[NDArray[Any]] = [np.array(value, kind) for value in column.values]
    if len({row.shape for row in rows}) == 1:
        return np.stack(rows)
    longest = [max(lengths) for lengths in zip(*(row.shape for row in rows), strict=True)]
    filler = np.nan if np.issubdtype(kind, np.floating) else 0
    padded = np.full((len(rows), *longest), filler, kind)
    for k, row in enumerate(rows):
        place: Any = (k, *(slice(length) for length in row.shape))
        padded[place] = row
    return padded

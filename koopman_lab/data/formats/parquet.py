"""A Parquet file a channel, for pandas, polars, DuckDB and the like."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import pyarrow as pa
from pyarrow import parquet

from koopman_lab.data.formats.decoded import (
    ARRIVAL,
    Column,
    Exported,
    channel_files,
    columns_by_channel,
)
from koopman_lab.eventlog.eventlog import Event
from koopman_lab.files import replacing_folder

_TYPES: dict[str, Any] = {
    "int8_t": pa.int8(),
    "int16_t": pa.int16(),
    "int32_t": pa.int32(),
    "int64_t": pa.int64(),
    "byte": pa.uint8(),
    "boolean": pa.bool_(),
    "float": pa.float32(),
    "double": pa.float64(),
    "string": pa.string(),
}


def write(events: Iterable[Event], folder: Path) -> Exported:
    """Write a folder with a file ``CHANNEL.parquet`` each, whole or not at all.

    Columns are the fields of the messages by their names, with the types that they have on the
    wire, arrays as lists; in front stands ``arrival_us``, when the logger received the message.

    Raises
    ------
    OSError
        If ``folder`` exists and is not empty, or cannot be written.
    LogError
        If no message can be decoded.
    """
    written = Exported.nothing()
    tables = columns_by_channel(events, written)
    with replacing_folder(folder) as temporary:
        files = channel_files(temporary, tables, ".parquet")
        for file, (arrivals, columns) in zip(files, tables.values(), strict=True):
            arrays = {ARRIVAL: pa.array(arrivals, pa.int64())}
            arrays |= {column.name: _array(column) for column in columns}
            parquet.write_table(pa.table(arrays), file)
    return written


def _array(column: Column) -> Any:
    values, kind = column.values, _TYPES.get(column.kind)
    if kind is None:  # a struct of another package
        return pa.array([str(value) for value in values], pa.string())
    if column.kind == "boolean":
        values = [_truth(value) for value in values]
    for _ in range(column.dimensions):
        kind = pa.list_(kind)
    return pa.array(values, kind)


def _truth(value: Any) -> Any:
    """Return truth values for the 0 and 1 of generated code."""
    return [_truth(item) for item in value] if isinstance(value, list | tuple) else bool(value)

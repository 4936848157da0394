"""The rows of a study as they come: a line of JSON each, with a checksum."""

from __future__ import annotations

import json
import logging
import os
import zlib
from collections.abc import Set
from pathlib import Path
from typing import Any

CHECKSUM = "crc32"
"""Key of the checksum in a line. Rows of older versions have none, and are run again."""


def line_of(row: dict[str, Any]) -> str:
    """Return the line of a row."""
    return json.dumps(row | {CHECKSUM: _checksum(row)}) + "\n"


def whole_rows(file: Path, keys: Set[str]) -> list[dict[str, Any]]:
    """Return the rows of a file that have all ``keys`` and are as they were written.

    What a torn last line held is taken off the file, and of other damaged lines a warning is
    logged.

    Raises
    ------
    OSError
        If the file cannot be read or cut.
    """
    content = file.read_bytes()
    complete = content[: content.rfind(b"\n") + 1]
    if complete != content:
        os.truncate(file, len(complete))
    lines = complete.splitlines()
    rows = [row for row in map(_row, lines) if row is not None and keys <= row.keys()]
    if len(rows) < len(lines):
        logging.getLogger(__name__).warning(
            "%s: %d of %d rows are damaged; they are run again",
            *(file, len(lines) - len(rows), len(lines)),
        )
    return rows


def _row(line: bytes) -> dict[str, Any] | None:
    """Return the row of a line, None if it is damaged."""
    try:
        row = json.loads(line)
    except (ValueError, RecursionError):
        return None
    if not isinstance(row, dict):
        return None
    return row if row.pop(CHECKSUM, None) == _checksum(row) else None


def _checksum(row: dict[str, Any]) -> int:
    return zlib.crc32(json.dumps(row, sort_keys=True).encode())

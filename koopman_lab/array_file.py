"""Arrays and a header of JSON in one ``.npz`` file, of which nothing is believed before it is seen.

What a file says of its sizes is held against the file itself before anything is allocated, what it
holds against a table of rows before anything is used. A refusal is one line: file, entry, what was
expected and what is there.
"""

from __future__ import annotations

import json
import math
import struct
import tokenize
import zipfile
import zlib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any, Literal, NamedTuple

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from koopman_lab.files import open_file, replacing
from koopman_lab.json_file import Refusal, first_line, parsed_table

HEADER = "header"
MOST_ENTRIES = 4096
LARGEST_BYTES = 1 << 31
"""Unpacked. Assumption: a day of the paper's cameras makes a data set of 1.3 GB."""
SMALL_BYTES, MOST_TIMES = 1 << 26, 20
"""An archive that unpacks to more than both, 64 MiB and so many times its size, is a trap."""
LARGEST_MAGNITUDE = 1e9
"""Of a number in SI units that a robot on a floor can have to do with; its powers do not overflow.
Assumption."""
KINDS = {"real": "fiu", "whole": "iu"}
_HARMLESS = "fiubUS"
"""Kinds of elements that hold no objects."""
_UNREADABLE = (
    *(OSError, ValueError, TypeError, KeyError, IndexError, EOFError, OverflowError, MemoryError),
    *(zipfile.BadZipFile, zlib.error, struct.error, tokenize.TokenError, SyntaxError),
    *(NotImplementedError, RuntimeError, UserWarning),
)
"""What zipfile, numpy and json raise for damaged files."""


@dataclass(frozen=True)
class ArrayRow:
    """One array as it must be; it is finite.

    Attributes
    ----------
    name
        Name of the entry.
    kind
        ``real`` becomes float64, ``whole`` int64.
    shape
        Sizes; a letter is any size that is the same wherever the letter stands in a table.
    smallest, largest
        Bounds of the elements.
    """

    name: str
    kind: Literal["real", "whole"]
    shape: tuple[int | str, ...]
    smallest: float = -LARGEST_MAGNITUDE
    largest: float = LARGEST_MAGNITUDE


class ArrayFile(NamedTuple):
    """What a file holds.

    Attributes
    ----------
    header
        The header.
    arrays
        All other entries by name, those of real numbers finite.
    """

    header: dict[str, Any]
    arrays: dict[str, NDArray[Any]]


def read_array_file(refusal: Refusal) -> ArrayFile:
    """Read the file of a refusal.

    Raises
    ------
    LabError
        The refusal's, if the file is missing, damaged, or larger than it may be.
    """
    try:
        with open_file(refusal.path) as raw, zipfile.ZipFile(raw) as archive:
            size = raw.seek(0, 2)
            entries = _entries(refusal, archive, size)
            arrays = {
                name: _read(refusal, name, archive.open(info), info.file_size)
                for name, info in entries.items()
            }
    except FileNotFoundError:
        raise refusal.missing() from None
    except _UNREADABLE as error:
        raise refusal.because(first_line(error)) from None
    return ArrayFile(_header(refusal, arrays.pop(HEADER, None)), arrays)


def read_array(refusal: Refusal, row: ArrayRow) -> NDArray[Any]:
    """Read an ``.npy`` file, which is one array.

    Raises
    ------
    LabError
        The refusal's, if the file is missing, damaged, or not of the row.
    """
    try:
        with open_file(refusal.path) as raw:
            size = raw.seek(0, 2)
            raw.seek(0)
            array = _read(refusal, row.name, raw, size)
    except _UNREADABLE as error:
        raise refusal.because(first_line(error)) from None
    return checked_arrays(refusal, {row.name: array}, [row])[row.name]


def write_array_file(path: Path, header: Mapping[str, Any], arrays: Mapping[str, Any]) -> None:
    """Write a header of JSON and arrays, whole or not at all.

    Raises
    ------
    DiskError
        If the file cannot be written.
    """
    text = json.dumps(header, sort_keys=True).encode()
    with replacing(path) as file:
        np.savez(file, header=np.frombuffer(text, np.uint8), **arrays)


def checked_arrays(
    refusal: Refusal, arrays: Mapping[str, NDArray[Any]], rows: Iterable[ArrayRow]
) -> dict[str, NDArray[Any]]:
    """Return the arrays of a table of rows, in the types of the rows.

    Raises
    ------
    LabError
        The refusal's; the message names the first array that is not as its row says.
    """
    sizes: dict[str, int] = {}
    checked = {}
    for row in rows:
        array = arrays.get(row.name)
        shape = tuple(sizes.get(n, n) if isinstance(n, str) else n for n in row.shape)
        expected = f"{row.kind} numbers of shape ({', '.join(map(str, shape))})"
        if array is None:
            raise refusal.entry(row.name, expected, "no such entry")
        fits = len(array.shape) == len(shape) and all(
            isinstance(size, str) or size == actual
            for size, actual in zip(shape, array.shape, strict=True)
        )
        if not fits or array.dtype.kind not in KINDS[row.kind]:
            raise refusal.entry(row.name, expected, f"{array.dtype} of shape {array.shape}")
        sizes |= {n: size for n, size in zip(row.shape, array.shape, strict=True) if n in shape
                  and isinstance(n, str)}  # fmt: skip
        outside = ~((array >= row.smallest) & (array <= row.largest))
        if outside.any():
            place = tuple(np.argwhere(outside)[0].tolist())
            bounds = f"numbers from {row.smallest:g} to {row.largest:g}"
            raise refusal.entry(row.name, bounds, f"{array[place]} at {list(place)}")
        checked[row.name] = array.astype(np.float64 if row.kind == "real" else np.int64)
    return checked


def _entries(refusal: Refusal, archive: zipfile.ZipFile, size: int) -> dict[str, zipfile.ZipInfo]:
    """Return the entries by name, if they can be unpacked without harm."""
    listed = archive.infolist()
    entries = {info.filename.removesuffix(".npy"): info for info in listed}
    if len(entries) < len(listed) or len(listed) > MOST_ENTRIES:
        raise refusal.because(
            f"{len(listed)} entries of {len(entries)} names (at most {MOST_ENTRIES} may be there)"
        )
    unpacked = sum(info.file_size for info in listed)
    if unpacked > min(max(SMALL_BYTES, MOST_TIMES * size), LARGEST_BYTES):
        raise refusal.because(f"its {size} bytes unpack to {unpacked}, more than such a file has")
    return entries


def _read(refusal: Refusal, name: str, stream: IO[bytes], size: int) -> NDArray[Any]:
    """Read an array whose entry has so many bytes; its shape must account for all of them."""
    with stream:
        version = npy.read_magic(stream)
        if version not in ((1, 0), (2, 0)):
            raise refusal.entry(name, "an array of format 1.0 or 2.0", f"{version}")
        read = npy.read_array_header_1_0 if version == (1, 0) else npy.read_array_header_2_0
        shape, is_fortran, dtype = read(stream)
        if dtype.kind not in _HARMLESS or min(shape, default=0) < 0:
            raise refusal.entry(name, "numbers", f"{dtype} of shape {shape}")
        expected, present = math.prod(shape) * dtype.itemsize, size - stream.tell()
        if expected != present:
            raise refusal.entry(
                name, f"{expected} bytes, as {dtype} of shape {shape} has", f"{present}"
            )
        block = np.frombuffer(stream.read(), dtype)
    array = block.reshape(shape, order="F" if is_fortran else "C")
    if dtype.kind == "f" and not np.isfinite(array).all():
        place = np.argwhere(~np.isfinite(array))[0].tolist()
        raise refusal.entry(name, "finite numbers", f"{array[tuple(place)]} at {place}")
    native: NDArray[Any] = array.astype(dtype.newbyteorder("="))
    return native


def _header(refusal: Refusal, stored: NDArray[Any] | None) -> dict[str, Any]:
    if stored is None or stored.dtype != np.uint8 or stored.ndim != 1:
        seen = "no such entry" if stored is None else f"{stored.dtype} of shape {stored.shape}"
        raise refusal.entry(HEADER, "JSON in bytes", seen)
    return parsed_table(refusal, stored.tobytes(), HEADER)

"""The published form of a data set: a folder of X_i.dat and Y_i.dat, i the basis input.

So are the sets of DOI 10.18419/DARUS-4538 laid out. What their files hold exactly is not known
here; when shapes do not fit, the message says what was found. A folder that :func:`write_folder`
made also says robot, sampling time, and the run and time of each pair; others need not.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from koopman_lab.array_file import LARGEST_MAGNITUDE
from koopman_lab.config.load import load_config
from koopman_lab.data.dataset import DataSet
from koopman_lab.data.metadata import DataSetMetadata, SamplingTime
from koopman_lab.data.number_table import read_number_table
from koopman_lab.errors import ConfigError, DataError
from koopman_lab.files import replacing, replacing_folder, write_json
from koopman_lab.geometry.planar import TAU, wrap_angle
from koopman_lab.json_file import JsonTable, Refusal, read_table
from koopman_lab.robots.table import ROBOTS, robot_type

Array = NDArray[np.float64]
HEADER = "dataset.json"
EXACT, INTEGER = "%.17g", "%d"
"""Formats that lose no bit."""
_NAME = re.compile(r"([XY])_(\d+)\.dat")
_INDEX = re.compile(r"\d{1,3}")
BasisInput = Annotated[float, Field(ge=-LARGEST_MAGNITUDE, le=LARGEST_MAGNITUDE)]


def is_folder(path: Path) -> bool:
    """Return whether this is a folder of such files."""
    return path.is_dir() and any(_NAME.fullmatch(entry.name) for entry in path.iterdir())


def write_folder(dataset: DataSet, folder: Path) -> None:
    """Write X_i.dat and Y_i.dat, a row for each pair, and what else the data set knows.

    Beside them ``pairs_i.dat`` with the run and the time (us) of each pair, and ``dataset.json``.
    The folder appears whole or not at all.

    Raises
    ------
    DataError
        If there is something in the folder.
    OSError
        If it cannot be written.
    """
    if folder.is_dir() and any(folder.iterdir()):
        raise DataError(f"{folder}: is not empty; choose another folder with --out")
    header = {
        "robot_kind": dataset.robot_kind,
        "dt_s": dataset.dt_s,
        "basis_inputs": {str(i): u.tolist() for i, u in sorted(dataset.basis_inputs.items())},
        "metadata": dict(dataset.metadata),
    }
    with replacing_folder(folder) as place:
        for index in sorted(dataset.basis_inputs):
            origin = np.column_stack([dataset.segments[index], dataset.start_us[index]])
            _write(place / f"X_{index}.dat", dataset.X[index], EXACT)
            _write(place / f"Y_{index}.dat", dataset.Y[index], EXACT)
            _write(place / f"pairs_{index}.dat", origin, INTEGER)
        write_json(place / HEADER, header)


def read_folder(
    folder: Path,
    robot_kind: str | None = None,
    dt_s: float | None = None,
    basis_inputs: Mapping[int, Sequence[float]] | None = None,
) -> DataSet:
    """Read a folder of X_i.dat and Y_i.dat.

    Whether a pair is a row or a column is told by the number of states, for all files together.
    Angles of Y are continued from those of X, and both shifted so that X lies in (-pi, pi].

    Parameters
    ----------
    folder
        Holds the files.
    robot_kind, dt_s
        The robot's name and the time from X to Y (s); needed where the folder does not say them.
    basis_inputs
        In place of those the folder says, or else of those of the paper, by index. Files of i = 0
        may be there or not for a robot without drift, and are of zero input.

    Raises
    ------
    DataError
        If files are missing, hold no numbers, or do not fit together.
    """
    if not is_folder(folder):
        raise DataError(f"{folder}: holds no X_i.dat; give a folder of X_i.dat and Y_i.dat")
    header = _header(folder)
    for key, flag, option in (("robot_kind", "--robot", robot_kind), ("dt_s", "--dt", dt_s)):
        if option is not None and key in header and header[key] != option:
            raise DataError(f"{folder}: is of {flag} {header[key]}, not {option}; leave out {flag}")
    kind: str | None = header.get("robot_kind", robot_kind)
    dt_s = header.get("dt_s", dt_s)
    if kind is None or dt_s is None:
        raise DataError(
            f"{folder}: does not say its robot and sampling time; say "
            f"{' or '.join(f'--robot {name}' for name in ROBOTS.names())}, and --dt with the "
            "seconds from X to Y"
        )
    if not 0.0 < dt_s < float("inf"):
        raise DataError(f"{folder}: sampling time {dt_s} s; say the seconds from X to Y with --dt")
    inputs = _inputs(folder, kind, basis_inputs or header.get("basis_inputs"))
    files = {
        (letter, index): _read(folder / f"{letter}_{index}.dat", kind)
        for index in inputs
        for letter in "XY"
    }
    pairs = _as_rows(folder, files, kind, known=bool(header))
    X, Y, segments, start_us = {}, {}, {}, {}
    shifted = 0
    for index in inputs:
        x, y = pairs["X", index], pairs["Y", index]
        if x.shape != y.shape:
            raise DataError(
                f"{folder}: X_{index}.dat holds {len(x)} states, Y_{index}.dat {len(y)}; "
                "each state of X needs its successor in Y"
            )
        X[index], Y[index], count = _with_continued_angles(x, y)
        shifted += count
        segments[index], start_us[index] = _runs_and_times(folder / f"pairs_{index}.dat", len(x))
    metadata = header.get("metadata") or {
        "imported_from": folder.name,
        "segments_known": (folder / f"pairs_{min(inputs)}.dat").exists(),
        "angles_shifted": shifted,
    }
    return DataSet(
        X, Y, segments, start_us, {i: np.array(u) for i, u in inputs.items()}, dt_s, kind, metadata
    )


def _write(path: Path, rows: NDArray[Any], numbers: str) -> None:
    with replacing(path) as file:
        np.savetxt(file, rows, fmt=numbers)


class _Header(JsonTable):
    """What ``dataset.json`` says."""

    robot_kind: str
    dt_s: SamplingTime
    basis_inputs: dict[str, tuple[BasisInput, ...]]
    metadata: DataSetMetadata


def _header(folder: Path) -> dict[str, Any]:
    path = folder / HEADER
    if not path.exists():
        return {}
    remedy = "remove it, and say --robot and --dt instead"
    refusal = Refusal(path, "the header of a data set", remedy, DataError)
    header = read_table(refusal, _Header)
    try:
        input_dim = robot_type(header.robot_kind).input_dim
    except ConfigError as error:
        raise DataError(f"{path}: {error}") from None
    for index, u in header.basis_inputs.items():
        if not _INDEX.fullmatch(index) or len(u) != input_dim:
            raise refusal.entry(
                f"basis_inputs.{index}", f"{input_dim} numbers under an index", str(u)
            )
    return {
        "robot_kind": header.robot_kind,
        "dt_s": header.dt_s,
        "basis_inputs": {int(i): u for i, u in header.basis_inputs.items()},
        "metadata": header.metadata.model_dump(exclude_unset=True, mode="json"),
    }


def _inputs(
    folder: Path, kind: str, stated: Mapping[int, Sequence[float]] | None
) -> dict[int, Sequence[float]]:
    """Return the basis inputs by index, after a look at which files there are."""
    inputs = dict(stated or load_config(robot=kind).sampler.indexed_inputs)
    names = {entry.name for entry in folder.iterdir() if _NAME.fullmatch(entry.name)}
    if 0 not in inputs and "X_0.dat" in names:
        inputs = {0: (0.0,) * robot_type(kind).input_dim} | inputs
    expected = {f"{letter}_{index}.dat" for index in inputs for letter in "XY"}
    for problem, misfits in (
        ("lacks", expected - names),
        ("has no basis input for", names - expected),
    ):
        if misfits:
            raise DataError(
                f"{folder}: {problem} {', '.join(sorted(misfits))}; a data set of the {kind} robot "
                f"is {', '.join(sorted(expected))} (see --robot)"
            )
    return inputs


def _read(path: Path, kind: str) -> Array:
    """Return the table that a file holds, (0, 0) if it is empty."""
    table = read_number_table(path)
    names = robot_type(kind).state_names
    states = [word for word in table.header if word in names]
    if sorted(states) == sorted(names) and states != list(names):
        raise DataError(
            f"{path}: its header names {', '.join(states)}; write the columns in the order "
            f"{', '.join(names)}"
        )
    return table.numbers


def _as_rows(
    folder: Path, files: Mapping[tuple[str, int], Array], kind: str, *, known: bool
) -> dict[tuple[str, int], Array]:
    """Return every table with a state in each row (d, n); where that is ``known`` it must be so."""
    names = robot_type(kind).state_names
    n = len(names)
    filled = {key: table for key, table in files.items() if table.size}
    rows = all(table.shape[1] == n for table in filled.values())
    columns = all(table.shape[0] == n for table in filled.values()) and not (known and rows)
    if rows == columns and filled:
        shapes = ", ".join(
            f"{letter}_{index}.dat {t.shape[0]} by {t.shape[1]}"
            for (letter, index), t in files.items()
        )
        reason = "both rows and columns" if rows else "neither all rows nor all columns"
        raise DataError(
            f"{folder}: {reason} hold {n} numbers ({', '.join(names)} of the {kind} robot); found "
            f"{shapes}; see --robot, and leave out what else the files hold, such as times"
        )
    return {
        key: np.zeros((0, n)) if not t.size else np.ascontiguousarray(t if rows else t.T)
        for key, t in files.items()
    }


def _with_continued_angles(x: Array, y: Array) -> tuple[Array, Array, int]:
    """Return X and Y with the angles as they should be, and how many pairs that changed."""
    theta_x = x[:, 2]
    turns_x = np.rint((theta_x - wrap_angle(theta_x)) / TAU)
    # In one sampling time the robot turns by far less than half a turn.
    turns_y = turns_x + np.rint((y[:, 2] - theta_x) / TAU)
    x, y = x.copy(), y.copy()
    x[:, 2] -= TAU * turns_x
    y[:, 2] -= TAU * turns_y
    return x, y, int(np.count_nonzero((turns_x != 0.0) | (turns_y != 0.0)))


def _runs_and_times(path: Path, count: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the run and the time of each pair; all of one run at no known time if not said."""
    if not path.exists():
        return np.zeros(count, np.int64), np.zeros(count, np.int64)
    try:
        table = np.loadtxt(path, np.int64, ndmin=2) if path.stat().st_size else np.zeros((0, 2))
    except (OSError, ValueError) as error:
        raise DataError(f"{path}: not a table of whole numbers ({error})") from None
    if table.shape != (count, 2):
        raise DataError(
            f"{path}: {table.shape[0]} by {table.shape[1]} numbers, expected {count} by 2 (run and "
            "time of each pair); remove the file if it is not of this data set"
        )
    return table[:, 0].astype(np.int64), table[:, 1].astype(np.int64)

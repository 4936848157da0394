"""Data sets: pairs of states and successors, sorted by the basis input they were taken under."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from koopman_lab.array_file import (
    ArrayRow,
    checked_arrays,
    read_array_file,
    write_array_file,
)
from koopman_lab.config.schema import LabConfig
from koopman_lab.data.collect import collect
from koopman_lab.data.decode import SessionLog
from koopman_lab.data.metadata import DataSetMetadata, SamplingTime
from koopman_lab.data.recording import recording
from koopman_lab.errors import ConfigError, DataError
from koopman_lab.json_file import JsonTable, Refusal, checked_table
from koopman_lab.robots.robot_type import RobotType
from koopman_lab.robots.table import robot_type

FORMAT = 1
"""Version of the file; raised when its meaning changes."""
_REMEDY = "`klab dataset make SESSION` makes one"
_TABLES = ("X", "Y", "segments", "start_us", "basis_inputs")
MOST_BASIS_INPUTS = 256
ANY_INT64 = {"smallest": -(2.0**63), "largest": 2.0**63}


class _Header(JsonTable):
    """What the header of a data set's file says."""

    format: int
    dt_s: SamplingTime
    robot_kind: str
    indices: Annotated[list[Annotated[int, Field(ge=0)]], Field(max_length=MOST_BASIS_INPUTS)]
    metadata: DataSetMetadata


@dataclass(frozen=True, eq=False)
class DataSet:
    """Pairs of states and successors for each basis input.

    Attributes
    ----------
    X, Y
        By basis index: states (d, n), and the states (d, n) dt later, in the units of the robot's
        states. Angles of X lie in (-pi, pi], those of Y go on from there.
    segments
        By basis index: number of the run each pair is from (d,).
    start_us
        By basis index: utime of each state in X (d,) in us.
    basis_inputs
        By basis index: the input (m,) in the units of the robot's inputs. An index that is not
        here was not meant to be sampled.
    dt_s
        Sampling time (s).
    robot_kind
        Name of the robot whose states and inputs these are.
    metadata
        How the data were made; JSON.

    Raises
    ------
    DataError
        If the arrays do not fit together.
    ConfigError
        If there is no such robot; the message lists the known ones.
    """

    X: dict[int, NDArray[np.float64]]
    Y: dict[int, NDArray[np.float64]]
    segments: dict[int, NDArray[np.int64]]
    start_us: dict[int, NDArray[np.int64]]
    basis_inputs: dict[int, NDArray[np.float64]]
    dt_s: float
    robot_kind: str
    metadata: Mapping[str, Any]

    def __post_init__(self) -> None:
        n, m = self.robot.state_dim, self.robot.input_dim
        for name, table in self._tables():
            if table.keys() != self.basis_inputs.keys():
                raise DataError(
                    f"data set: {name} is of the basis inputs {sorted(table)}, "
                    f"expected {sorted(self.basis_inputs)}"
                )
            for index, array in table.items():
                samples = len(self.X[index])
                columns = {"X": (samples, n), "Y": (samples, n), "basis_inputs": (m,)}
                expected = columns.get(name, (samples,))
                if array.shape != expected:
                    raise DataError(
                        f"data set of the {self.robot_kind} robot: {name} of basis input {index} "
                        f"has shape {array.shape}, expected {expected}"
                    )

    @property
    def robot(self) -> RobotType:
        """Return whose states and inputs these are."""
        return robot_type(self.robot_kind)

    @property
    def data_hash(self) -> str:
        """Return the SHA-256 of everything a fit depends on, the same on every machine."""
        digest = hashlib.sha256(f"{self.robot_kind} {self.dt_s!r}".encode())
        for name, table in self._tables():
            for index, array in sorted(table.items()):
                little = np.ascontiguousarray(array, array.dtype.newbyteorder("<"))
                digest.update(f" {name}_{index} {little.dtype.str} {little.shape} ".encode())
                digest.update(little.tobytes())
        return digest.hexdigest()

    def save(self, path: Path | str) -> None:
        """Write one ``.npz`` file without pickle, whole or not at all."""
        header = {
            "format": FORMAT,
            "dt_s": self.dt_s,
            "robot_kind": self.robot_kind,
            "indices": sorted(self.basis_inputs),
            "metadata": dict(self.metadata),
        }
        arrays: dict[str, Any] = {
            f"{name}_{index}": array
            for name, table in self._tables()
            for index, array in sorted(table.items())
        }
        write_array_file(Path(path), header, arrays)

    @classmethod
    def load(cls, path: Path | str) -> DataSet:
        """Read a file that :meth:`save` wrote.

        Raises
        ------
        DataError
            If the file is missing, damaged, no data set, or of another version.
        """
        path = Path(path)
        refusal = Refusal(path, "a data set", _REMEDY, DataError)
        header, arrays = read_array_file(refusal)
        if "matrices" in arrays:
            raise refusal.because("a model, whose formats are others")
        version = header.get("format")
        if type(version) is int and version != FORMAT:
            raise DataError(
                f"{path}: data set of format {version}, this version reads {FORMAT}; make it again "
                "from its session"
            )
        checked = checked_table(refusal, header, _Header)
        try:
            robot = robot_type(checked.robot_kind)
        except ConfigError as error:
            raise DataError(f"{path}: {error}") from None
        content = checked_arrays(refusal, arrays, _rows(checked.indices, robot))
        tables: dict[str, Any] = {
            name: {index: content[f"{name}_{index}"] for index in checked.indices}
            for name in _TABLES
        }
        metadata = header["metadata"]
        if checked.metadata.session is not None:
            metadata |= {"session": checked.metadata.session.as_dict()}
        return cls(**tables, dt_s=checked.dt_s, robot_kind=checked.robot_kind, metadata=metadata)

    @classmethod
    def from_log(
        cls,
        path: Path | str | SessionLog,
        config: LabConfig | None = None,
        *,
        robot_name: str | None = None,
        dt_s: float | None = None,
        window: int | None = None,
        salvage: bool = False,
    ) -> DataSet:
        """Make the data set of a session (paper, section 5.2).

        Parameters
        ----------
        path
            A session log, the folder that holds ``session.lcm``, or a log already read.
        config
            In place of the configuration that the log says.
        robot_name
            The robot whose data is meant; needed only where the log holds several robots.
        dt_s, window
            In place of ``processing.dt_s`` and ``processing.smoothing_window``.
        salvage
            Pass over what is damaged.

        Raises
        ------
        LogError
            If the log cannot be used or does not say its configuration.
        ConfigError
            If the configuration in the log is not valid.
        DataError
            If the log holds no complete run of a basis input or is of another configuration.
        """
        if isinstance(path, SessionLog):
            log = path
        else:
            log = SessionLog(path, robot_name=robot_name, salvage=salvage)
        recorded = recording(log, config, dt_s=dt_s, window=window)
        lab, settings = recorded.config, recorded.settings
        rate_hz, inputs = lab.mocap.rate_hz, lab.sampler.indexed_inputs
        collected = {
            index: collect(
                recorded.segments_of(index), robot_type(lab.robot.kind), settings, rate_hz
            )
            for index in inputs
        }
        metadata = {
            "robot_name": recorded.robot_name,
            "robot": lab.robot.model_dump(mode="json"),
            "frame_rate_hz": rate_hz,
            "processing": settings.model_dump(mode="json"),
            "marker": recorded.marker.as_dict(),
            "runs": len(recorded.runs),
            "runs_given_up": recorded.given_up,
            "session": recorded.account.as_dict(),
            "basis_inputs": {str(index): part.account for index, part in collected.items()},
        }
        return cls(
            X={index: part.X for index, part in collected.items()},
            Y={index: part.Y for index, part in collected.items()},
            segments={index: part.segments for index, part in collected.items()},
            start_us={index: part.start_us for index, part in collected.items()},
            basis_inputs={index: np.array(u) for index, u in inputs.items()},
            dt_s=settings.dt_s,
            robot_kind=lab.robot.kind,
            metadata=metadata,
        )

    def __repr__(self) -> str:
        pairs = ", ".join(
            f"{len(self.X[index])} pairs under u_{index} = ({', '.join(f'{v:g}' for v in u)})"
            for index, u in sorted(self.basis_inputs.items())
        )
        return f"DataSet({self.robot_kind} robot, dt {self.dt_s:g} s: {pairs})"

    def _tables(self) -> list[tuple[str, dict[int, NDArray[Any]]]]:
        return [(name, getattr(self, name)) for name in _TABLES]


def _rows(indices: Sequence[int], robot: RobotType) -> Iterator[ArrayRow]:
    """Give what a file holds by basis index."""
    n, m = robot.state_dim, robot.input_dim
    for i in indices:
        pairs = f"pairs of basis input {i}"
        yield ArrayRow(f"X_{i}", "real", (pairs, n))
        yield ArrayRow(f"Y_{i}", "real", (pairs, n))
        yield ArrayRow(f"segments_{i}", "whole", (pairs,), **ANY_INT64)
        yield ArrayRow(f"start_us_{i}", "whole", (pairs,), **ANY_INT64)
        yield ArrayRow(f"basis_inputs_{i}", "real", (m,))

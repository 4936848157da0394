"""The one table of formats that logs are written in for other programs, and read from.

Another package adds one by an entry point of the group ``koopman_lab.log_formats``, whose name is
what a person types behind ``klab log export --format`` and whose value a :class:`LogFormat`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from koopman_lab.errors import LogError
from koopman_lab.registry import Registry

if TYPE_CHECKING:
    from koopman_lab.data.formats.decoded import Exported
    from koopman_lab.data.formats.recorded_motion import RecordedMessage
    from koopman_lab.eventlog.eventlog import Event

Write = Callable[["Iterable[Event]", Path], "Exported"]
Read = Callable[[Path], "Iterable[RecordedMessage]"]
BAG_METADATA = "metadata.yaml"
"""What makes a folder a bag."""


@dataclass(frozen=True)
class LogFormat:
    """One format.

    Attributes
    ----------
    name
        As in ``--format``.
    title
        What is written, and for whom, in words for a person.
    ending
        What the name of the file or folder ends in, behind that of the log.
    write
        Writes events of a log to a path, whole or not at all, and returns what was written. A
        callable, or where it is, as ``module:attribute``. It raises OSError where the path cannot
        be written, and :class:`~koopman_lab.errors.LogError` where no message can be decoded.
    extra
        What must be installed for it (``pyproject.toml``); empty for nothing.
    recording
        What recordings of others in it are, in words for a person.
    recognises
        Returns whether a path is one, by its name and what lies in it; None where none is read.
    read
        Gives the messages of a recording, those that may hold poses or commands decoded; a callable
        or where it is. It raises :class:`~koopman_lab.errors.LogError` where that cannot be read.
    """

    name: str
    title: str
    ending: str
    write: str | Write
    extra: str = ""
    recording: str = ""
    recognises: Callable[[Path], bool] | None = None
    read: str | Read | None = None


_HERE = "koopman_lab.data.formats"
FORMATS: Registry[LogFormat] = Registry(
    "log format",
    "koopman_lab.log_formats",
    LogFormat,
    {
        row.name: row
        for row in (
            LogFormat(
                "csv", "a CSV file a channel, for PlotJuggler", "-csv", f"{_HERE}.csv_tables:write"
            ),
            LogFormat(
                "mcap",
                "one MCAP file, for Foxglove: its 3D panel shows the lab",
                ".mcap",
                f"{_HERE}.mcap_file:write",
                extra="mcap",
                recording="a file that ends in .mcap",
                recognises=lambda path: path.suffix == ".mcap" and not path.is_dir(),
                read=f"{_HERE}.mcap_source:mcap_messages",
            ),
            LogFormat(
                "ros2",
                "a ROS 2 bag: poses, twists, tf, for rviz and ros2 bag play",
                "-ros2",
                f"{_HERE}.ros2_bag:write",
                extra="ros2",
                recording=f"the folder of a ROS 2 bag, with its {BAG_METADATA}",
                recognises=lambda path: (path / BAG_METADATA).exists(),
                read=f"{_HERE}.ros2_source:bag_messages",
            ),
            LogFormat(
                "mat",
                "one .mat file, a struct a channel, for MATLAB and Octave",
                ".mat",
                f"{_HERE}.matlab:write",
                extra="desk",
            ),
            LogFormat(
                "parquet",
                "a Parquet file a channel, for pandas, polars, DuckDB",
                "-parquet",
                f"{_HERE}.parquet:write",
                extra="parquet",
            ),
        )
    },
)


def writer_of(name: str) -> Write:
    """Return what writes a log in a format.

    Raises
    ------
    ConfigError
        If there is no such format.
    PluginError
        If it is another package's, and cannot be used.
    """
    write: Write = FORMATS.load(name, FORMATS.get(name).write)
    return write


def read_recording(path: Path) -> Iterable[RecordedMessage]:
    """Return the messages of a recording of another program, in whichever format it is.

    Raises
    ------
    LogError
        If it is in none that can be read.
    PluginError
        If the format is another package's, and cannot be used.
    """
    readable = [row for row in FORMATS if row.recognises is not None]
    for row in readable:
        if row.recognises is not None and row.recognises(path):
            read: Read = FORMATS.load(row.name, row.read)
            return read(path)
    kinds = "; or ".join(row.recording for row in readable)
    raise LogError(f"{path}: no recording that can be read; give {kinds}")

"""The one table of formats that logs are written in for other programs, and read from.

Another package adds one by an entry point of the group ``koopman_lab.log_formats``, whose name is
what a person types behind ``klab log export --format`` and whose value a :class:`LogFormat`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from koopman_lab.registry import Registry

if TYPE_CHECKING:
    from koopman_lab.data.formats.decoded import Exported
    from koopman_lab.eventlog.eventlog import Event

Write = Callable[["Iterable[Event]", Path], "Exported"]


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
    """

    name: str
    title: str
    ending: str
    write: str | Write
    extra: str = ""


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
            ),
            LogFormat(
                "ros2",
                "a ROS 2 bag: poses, twists, tf, for rviz and ros2 bag play",
                "-ros2",
                f"{_HERE}.ros2_bag:write",
                extra="ros2",
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

"""A data set from whatever a person has: a session, a data set file, a folder of .dat files."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

from koopman_lab.config.load import load_config
from koopman_lab.data.dat import is_folder, read_folder
from koopman_lab.data.dataset import DataSet
from koopman_lab.data.decode import PassedOver, SessionLog
from koopman_lab.errors import DataError
from koopman_lab.eventlog.log_name import log_file

ENDING = ".npz"
GEOMETRY = ("wheel_radius_m", "track_width_m")


class Source(NamedTuple):
    """A data set and where it comes from.

    ``dictionary`` is that of the session's configuration, or of the robot's defaults; ``folder``
    is where things made of the data belong; ``passed_over`` is what of a log nobody could use, None
    where the data come from no log.
    """

    dataset: DataSet
    dictionary: str
    file: Path
    folder: Path
    passed_over: PassedOver | None


def open_source(
    path: Path,
    *,
    robot_kind: str | None = None,
    dt_s: float | None = None,
    window: int | None = None,
    salvage: bool = False,
) -> Source:
    """Return the data set of a session, a file of :meth:`DataSet.save`, or a folder of .dat files.

    Parameters
    ----------
    path
        A log, the folder that holds ``session.lcm``, a ``.npz`` file, or a folder of X_i.dat.
    robot_kind
        The robot of a folder of .dat files, where the folder does not say it.
    dt_s, window
        Sampling time (s) and smoothing window (frames) in place of the session's.
    salvage
        Pass over what is damaged in a log.

    Raises
    ------
    LabError
        If it cannot be read, or a data set that is already made is asked for with another
        sampling time, window or robot.
    """
    if is_folder(path):
        dataset = read_folder(path, robot_kind, dt_s)
    elif path.suffix == ENDING:
        dataset = DataSet.load(path)
    else:
        log = SessionLog(path, salvage=salvage)
        config = log.config()
        dataset = DataSet.from_log(log, config, dt_s=dt_s, window=window)
        _require_processing(log.path, dataset, robot_kind, dt_s, window)
        return Source(dataset, config.model.dictionary, log.path, log.path.parent, log.passed_over)
    _require_processing(path, dataset, robot_kind, dt_s, window)
    name = load_config(robot=dataset.robot_kind).model.dictionary
    return Source(dataset, name, path, folder_of(path), None)


def is_there(path: Path) -> bool:
    """Return whether there is anything at a source that :func:`open_source` could read."""
    return is_folder(path) or (path if path.suffix == ENDING else log_file(path)).exists()


def folder_of(path: Path) -> Path:
    """Return where things made of a source belong, which :func:`open_source` need not have read."""
    if is_folder(path):
        return path
    return path.parent if path.suffix == ENDING else log_file(path).parent


def window_of(dataset: DataSet) -> int | None:
    """Return the smoothing window (frames) that a data set says, None if it says none."""
    processing = dataset.metadata.get("processing")
    return processing.get("smoothing_window") if isinstance(processing, dict) else None


def geometry_of(metadata: Mapping[str, Any]) -> dict[str, float | None]:
    """Return the lengths (m) that turn commands into motion, by their keys in ``robot``.

    ``metadata`` are those of a data set; what they do not say is None.
    """
    robot = metadata.get("robot")
    return {name: robot.get(name) if isinstance(robot, dict) else None for name in GEOMETRY}


def _require_processing(
    path: Path,
    dataset: DataSet,
    robot_kind: str | None,
    dt_s: float | None,
    window: int | None,
) -> None:
    present = {"--robot": dataset.robot_kind, "--dt": dataset.dt_s, "--window": window_of(dataset)}
    requested = {"--robot": robot_kind, "--dt": dt_s, "--window": window}
    for flag, value in requested.items():
        if value is not None and value != present[flag]:
            known = "unknown" if present[flag] is None else present[flag]
            raise DataError(
                f"{path}: its data are of {flag} {known}, not {value}; leave out {flag} (only a "
                "session can be processed in another way)"
            )

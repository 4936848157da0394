"""Reads what the lab has recorded."""

from __future__ import annotations

from pathlib import Path

from koopman_lab.api.arguments import FilePath
from koopman_lab.data.dataset import DataSet
from koopman_lab.data.source import open_source


def read_data(
    path: FilePath,
    *,
    robot: str | None = None,
    dt_s: float | None = None,
    window: int | None = None,
    salvage: bool = False,
) -> DataSet:
    """Read a session or a data set: pairs of states and successors by basis input.

    Parameters
    ----------
    path
        A session's folder or its log, a file that :meth:`DataSet.save` wrote, or a folder of
        ``X_i.dat`` and ``Y_i.dat`` as the paper's authors publish theirs.
    robot
        The robot of a folder of ``.dat`` files, where the folder does not say it.
    dt_s
        Sampling time in s, in place of the session's.
    window
        Smoothing window in camera frames, in place of the session's.
    salvage
        Pass over what is damaged in a log.

    Raises
    ------
    LabError
        If it cannot be read, or a data set that is already made is asked for with another
        sampling time, window or robot.
    """
    source = open_source(Path(path), robot_kind=robot, dt_s=dt_s, window=window, salvage=salvage)
    return source.dataset

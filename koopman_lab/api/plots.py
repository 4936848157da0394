"""Draws runs, sessions and errors into files; a notebook shows what is returned."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from koopman_lab.api.arguments import FilePath
from koopman_lab.data.decode import SessionLog
from koopman_lab.errors import ArgumentError
from koopman_lab.evaluation.validation import Validation
from koopman_lab.figures.path_figure import Curve, draw_paths
from koopman_lab.figures.session_figure import draw_session, session_plot
from koopman_lab.figures.validation_figure import draw_validation
from koopman_lab.studies.closed_loop import Run

ENDINGS = (".png", ".pdf")


@dataclass(frozen=True)
class Picture:
    """A figure in two files; as the last line of a cell, a notebook shows it.

    Attributes
    ----------
    png, pdf
        The files.
    """

    png: Path
    pdf: Path

    def _repr_png_(self) -> bytes:
        return self.png.read_bytes()


def plot_paths(runs: Run | Mapping[str, Run], path: FilePath) -> Picture:
    """Draw the paths of simulated drives, and their value functions, into ``path``.png and .pdf.

    Parameters
    ----------
    runs
        A run, or several by the names that the legend shows.
    path
        Where to, with or without one of the two endings.

    Raises
    ------
    ArgumentError
        If there is no run.
    DiskError
        If a file cannot be written.
    """
    named = {"": runs} if isinstance(runs, Run) else dict(runs)
    if not named:
        raise ArgumentError("runs: 0 of them, expected at least 1")
    stem = _stem(path)
    curves = [
        Curve(name, run.time_s[:-1], run.states[:-1, :3], run.values) for name, run in named.items()
    ]
    draw_paths(stem, curves)
    return _picture(stem)


def plot_session(session: FilePath, path: FilePath, *, salvage: bool = False) -> Picture:
    """Draw path, speeds and commands of a session into ``path``.png and .pdf, as `klab log plot`.

    The numbers stand beside them as CSV files.

    Parameters
    ----------
    session
        Folder or log of a session of any kind.
    path
        Where to, with or without one of the two endings.
    salvage
        Pass over what is damaged in the log.

    Raises
    ------
    LogError
        If the log cannot be used, or holds no camera frame in which the robot was seen.
    DiskError
        If a file cannot be written.
    """
    stem = _stem(path)
    draw_session(stem, session_plot(SessionLog(Path(session), salvage=salvage)))
    return _picture(stem)


def plot_validation(validations: Sequence[Validation], path: FilePath) -> Picture:
    """Draw errors over the number of steps into ``path``.png and .pdf, the numbers into .csv.

    Parameters
    ----------
    validations
        From :func:`koopman_lab.validate`, of one session or several.
    path
        Where to, with or without one of the two endings.

    Raises
    ------
    ArgumentError
        If there is nothing to draw.
    DiskError
        If a file cannot be written.
    """
    if not validations:
        raise ArgumentError("validations: 0 of them, expected at least 1")
    stem = _stem(path)
    draw_validation(stem, validations)
    return _picture(stem)


def _stem(path: FilePath) -> Path:
    path = Path(path)
    return path.with_suffix("") if path.suffix in ENDINGS else path


def _picture(stem: Path) -> Picture:
    return Picture(stem.with_suffix(".png"), stem.with_suffix(".pdf"))

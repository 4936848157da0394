"""`klab train`: from a session log or a data set to a model."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from koopman_lab.config.schema import RobotKind
from koopman_lab.errors import ModelError
from offboard.console import options
from offboard.console.marker import marker_line
from offboard.console.terminal import err, out, show_damage

if TYPE_CHECKING:
    from koopman_lab.koopman.train import TrainingReport


def train(
    source: Annotated[
        Path,
        typer.Argument(
            metavar="SOURCE",
            help="A session, a data set .npz, or a folder of X_i.dat and Y_i.dat.",
        ),
    ],
    model: Annotated[
        Path | None,
        typer.Option("--out", metavar="FILE", help="Default: model.npz beside the source."),
    ] = None,
    dictionary: options.Dictionary = None,
    window: options.Window = None,
    dt_s: options.SamplingTime = None,
    robot: options.Robot = None,
    salvage: options.Salvage = False,
    as_json: options.AsJson = False,
) -> None:
    """Fit a bilinear Koopman model; prints samples, rank, condition.

    A folder of .dat files from elsewhere needs --robot and --dt.

    Example: klab train runs/calibration --window 40 --out runs/model.npz
    """
    learn(
        source,
        model,
        dictionary,
        window,
        dt_s,
        robot_kind=options.kind_of(robot),
        salvage=salvage,
        as_json=as_json,
    )


def learn(
    source: Path,
    model: Path | None = None,
    dictionary: str | None = None,
    window: int | None = None,
    dt_s: float | None = None,
    *,
    robot_kind: RobotKind | None = None,
    salvage: bool = False,
    as_json: bool = False,
) -> Path:
    """Train, print the report, and return where the model is.

    Raises
    ------
    LabError
        If the source cannot be used, or does not excite the dictionary.
    """
    from koopman_lab.data.source import open_source
    from koopman_lab.koopman.train import train as fit

    opened = open_source(source, robot_kind=robot_kind, dt_s=dt_s, window=window, salvage=salvage)
    learned, report = fit(opened.dataset, dictionary or opened.dictionary)
    path = model if model is not None else opened.folder / "model.npz"
    try:
        learned.save(path)
    except OSError as error:
        raise ModelError(
            f"{path}: cannot be written ({error.strerror}); choose another file with --out"
        ) from None
    show_damage(opened.file, opened.damage)
    if as_json:
        marker = opened.dataset.metadata.get("marker")
        out.print_json(json.dumps(report.as_dict() | {"model": str(path), "marker": marker}))
    else:
        _show(report)
        line = marker_line(opened.dataset.metadata)
        if line:
            out.print(line)
        err.print(f"model: {path}")
    return path


def _show(report: TrainingReport) -> None:
    from rich.table import Table

    table = Table(title=f"{report.dictionary}, {report.robot} robot, dt {report.dt_s:g} s")
    for column in ("basis input", "samples", "segments", "rank", "smallest sv", "condition"):
        table.add_column(column, justify="right")
    for basis in report.bases:
        name = f"u_{basis.basis_index} = ({basis.basis_input[0]:g}, {basis.basis_input[1]:g})"
        e = basis.excitation
        if e is None:
            table.add_row(name, "driftless: M_0 = I", "", "", "", "")
        else:
            table.add_row(
                name,
                str(e.samples),
                str(e.segments),
                f"{e.rank} of {e.observables}",
                f"{e.smallest_singular_value:.3g}",
                f"{e.condition:.3g}",
            )
    out.print(table)

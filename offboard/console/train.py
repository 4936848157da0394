"""`klab train`: from a session log to a model."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from koopman_lab.errors import ModelError
from offboard.console import options
from offboard.console.terminal import err, out

if TYPE_CHECKING:
    from koopman_lab.koopman.train import TrainingReport


def train(
    session: Annotated[
        Path, typer.Argument(metavar="SESSION_DIR_OR_LOG", help="From `klab calibrate`.")
    ],
    model: Annotated[
        Path | None,
        typer.Option("--out", metavar="FILE", help="Default: model.npz beside the log."),
    ] = None,
    dictionary: Annotated[
        str | None, typer.Option("--dictionary", metavar="D", help="D5t, D8Eul, D10m, D13t, D12f.")
    ] = None,
    window: Annotated[
        int | None, typer.Option("--window", min=1, help="Smoothing window of velocities, frames.")
    ] = None,
    dt_s: Annotated[
        float | None, typer.Option("--dt", metavar="S", help="Sampling time of the model, s.")
    ] = None,
    salvage: Annotated[
        bool, typer.Option("--salvage", help="Use every intact event of a damaged log.")
    ] = False,
    as_json: options.AsJson = False,
) -> None:
    """Fit a bilinear Koopman model to a session; prints samples, rank, condition.

    Example: klab train runs/calibration --window 40 --out runs/model.npz
    """
    learn(session, model, dictionary, window, dt_s, salvage=salvage, as_json=as_json)


def learn(
    session: Path,
    model: Path | None = None,
    dictionary: str | None = None,
    window: int | None = None,
    dt_s: float | None = None,
    *,
    salvage: bool = False,
    as_json: bool = False,
) -> Path:
    """Train, print the report, and return where the model is.

    Raises
    ------
    LabError
        If the session cannot be used, or does not excite the dictionary.
    """
    from koopman_lab.data.dataset import DataSet
    from koopman_lab.data.decode import SessionLog
    from koopman_lab.koopman.train import train as fit

    log = SessionLog(session, salvage=salvage)
    name = dictionary or log.config().model.dictionary
    dataset = DataSet.from_log(log, dt_s=dt_s, window=window)
    learned, report = fit(dataset, name)
    path = model if model is not None else log.path.with_name("model.npz")
    try:
        learned.save(path)
    except OSError as error:
        raise ModelError(
            f"{path}: cannot be written ({error.strerror}); choose another file with --out"
        ) from None
    if log.damage:
        skipped = sum(d.size for d in log.damage)
        err.print(f"{log.path}: {skipped} damaged bytes passed over")
    if as_json:
        out.print_json(json.dumps(report.as_dict() | {"model": str(path)}))
    else:
        _show(report)
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

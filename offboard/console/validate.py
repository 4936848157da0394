"""`klab validate`: how well models predict reference runs that they have not seen."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from koopman_lab.errors import DataError
from offboard.console import options
from offboard.console.folder import run_path
from offboard.console.terminal import err, out, progress, show_damage

if TYPE_CHECKING:
    from koopman_lab.data.decode import SessionLog
    from koopman_lab.koopman.metrics import Errors
    from koopman_lab.koopman.model import BilinearModel
    from koopman_lab.koopman.validation import Validation

FIGURE = "validation"


def validate(
    given: options.ModelsAndRuns,
    steps: Annotated[
        int, typer.Option("--steps", min=1, max=1000, help="How many sampling times to predict.")
    ] = 20,
    window: options.Window = None,
    out_folder: options.Out = None,
    salvage: options.Salvage = False,
    as_json: options.AsJson = False,
) -> None:
    """Predict from every camera frame of reference runs and compare with what happened.

    Each model with and without reprojection, the nominal equations beside them. DIR gets
    validation.csv with the errors of 1, 2, ... steps, and figures of them.

    Example: klab validate runs/D8Eul.npz runs/D10m.npz runs/infinity --out runs/validation
    """
    from koopman_lab.data.reference import reference_runs
    from koopman_lab.figures.validation import draw_validation
    from koopman_lab.koopman.validation import common_dt_s, require_robot
    from koopman_lab.koopman.validation import validate as measure

    models, logs = models_and_logs(given, salvage=salvage)
    common_dt_s(models)
    sessions = [reference_runs(log, window) for log in logs]
    for runs in sessions:
        require_robot(models, runs)
    found: list[Validation] = []
    total = len(sessions) * (2 * len(models) + 1)
    with progress("validating") as report:
        for runs in sessions:
            for validation in measure(models, runs, steps):
                found.append(validation)
                report(len(found), total, "predictors")
    folder = run_path(out_folder, "validation")
    try:
        draw_validation(folder / FIGURE, found)
    except OSError as error:
        raise DataError(
            f"{folder}: cannot be written ({error.strerror}); choose another folder with --out"
        ) from None
    for log in logs:
        show_damage(log.path, log.damage)
    if as_json:
        out.print_json(json.dumps({"steps": steps, "validations": [asdict(v) for v in found]}))
    else:
        for runs in sessions:
            _show([v for v in found if v.session == str(runs.path)], steps)
    err.print(f"figure and numbers: {folder / FIGURE}.png, .pdf, .csv")


def models_and_logs(
    given: Sequence[Path], *, salvage: bool
) -> tuple[dict[str, BilinearModel], list[SessionLog]]:
    """Return models by name and logs out of what a person listed together.

    Raises
    ------
    LabError
        If there is not at least one of both, or one cannot be read.
    """
    from koopman_lab.data.decode import SessionLog
    from koopman_lab.data.source import ENDING
    from koopman_lab.koopman.model import BilinearModel

    files = list(dict.fromkeys(path for path in given if path.suffix == ENDING))
    others = list(dict.fromkeys(path for path in given if path.suffix != ENDING))
    if not files or not others:
        missing = "model (a .npz file of `klab train`)"
        if files:
            missing = "reference run (a folder or log of `klab reference`)"
        raise DataError(f"{', '.join(map(str, given))}: no {missing} among them; name at least one")
    names = [path.stem for path in files]
    models = {
        path.stem if names.count(path.stem) == 1 else str(path): BilinearModel.load(path)
        for path in files
    }
    return models, [SessionLog(path, salvage=salvage) for path in others]


MEASURES: dict[str, Callable[[Errors], float]] = {
    "mean mm": lambda e: 1e3 * e.position_mean_m,
    "95 % mm": lambda e: 1e3 * e.position_p95_m,
    "max mm": lambda e: 1e3 * e.position_max_m,
    "mean deg": lambda e: math.degrees(e.angle_mean_rad),
    "95 % deg": lambda e: math.degrees(e.angle_p95_rad),
    "max deg": lambda e: math.degrees(e.angle_max_rad),
}


def _show(validations: Sequence[Validation], steps: int) -> None:
    from rich.table import Table

    first = validations[0]
    out.print(f"{first.session}: {first.runs} runs, {first.shape}")
    for ahead in dict.fromkeys((1, steps)):
        title = f"{ahead} step{'s' if ahead > 1 else ''} ahead"
        table = Table(title, box=None, pad_edge=False, collapse_padding=True)
        for name in ("starts", *MEASURES):
            table.add_column(name, justify="right")
        for v in validations:
            e = v.errors[ahead - 1]
            cells = (
                ["0"]
                if e is None
                else [str(e.starts), *(f"{of(e):.2f}" for of in MEASURES.values())]
            )
            table.add_row(v.label, *cells)
        out.print(table)

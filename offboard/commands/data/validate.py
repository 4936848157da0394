"""`klab validate`: how well models predict reference runs that they have not seen."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING

from koopman_lab.files import writing_where_named
from offboard.commands.data.validation_inputs import models_and_runs
from offboard.lab.run_folder import run_path
from offboard.terminal import options
from offboard.terminal.needs import needs
from offboard.terminal.output import err, out, progress

if TYPE_CHECKING:
    from koopman_lab.evaluation.metrics import Errors
    from koopman_lab.evaluation.validation import Validation

FIGURE = "validation"


@needs("desk")
def validate(
    paths: options.ModelsAndRuns,
    steps: options.Steps = 20,
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
    from koopman_lab.evaluation.validation import validate as measure
    from koopman_lab.figures.validation_figure import draw_validation

    models, sessions, _ = inputs = models_and_runs(paths, window, salvage=salvage)
    validations: list[Validation] = []
    total = len(sessions) * (2 * len(models) + 1)
    with progress("validating", "predictors") as report:
        for runs in sessions:
            for validation in measure(models, runs, steps):
                validations.append(validation)
                report(len(validations), total)
    folder = run_path(out_folder, "validation")
    with writing_where_named(folder):
        draw_validation(folder / FIGURE, validations)
    inputs.show_passed_over()
    if as_json:
        out.print_json(
            json.dumps({"steps": steps, "validations": [asdict(v) for v in validations]})
        )
    else:
        for runs in sessions:
            _show([v for v in validations if v.session == str(runs.path)], steps)
    err.print(f"figure and numbers: {folder / FIGURE}.png, .pdf, .csv")


POSE: dict[str, Callable[[Errors], float]] = {
    "mm": lambda e: 1e3 * e.position_mean_m,
    "95 %": lambda e: 1e3 * e.position_p95_m,
    "max": lambda e: 1e3 * e.position_max_m,
    "deg": lambda e: math.degrees(e.angle_mean_rad),
    "95 % ": lambda e: math.degrees(e.angle_p95_rad),
    "max ": lambda e: math.degrees(e.angle_max_rad),
}
VELOCITIES: dict[str, Callable[[Errors], float]] = {
    "mm/s": lambda e: 1e3 * (e.v_mean_m_per_s or 0.0),
    "deg/s": lambda e: math.degrees(e.omega_mean_rad_per_s or 0.0),
}
"""Of the second-order robot."""


def _show(validations: Sequence[Validation], steps: int) -> None:
    """Print a table for one step and one for the last; they fit into 80 characters."""
    from rich.table import Table

    first, one_step = validations[0], validations[0].errors[0]
    dynamic = one_step is not None and one_step.v_mean_m_per_s is not None
    measures = POSE | (VELOCITIES if dynamic else {})
    out.print(f"{first.session}: {first.runs} runs, {first.shape}")
    out.print("mean, 95th percentile, maximum; of velocities the mean")
    for ahead in dict.fromkeys((1, steps)):
        out.print(f"\n{ahead} step{'s' if ahead > 1 else ''} ahead")
        table = Table("model", "reprojected", box=None, pad_edge=False, collapse_padding=True)
        for name in ("starts", *measures):
            table.add_column(name, justify="right")
        for v in validations:
            errors = v.errors[ahead - 1]
            cells = ["0"]
            if errors is not None:
                cells = [
                    str(errors.starts),
                    *(f"{measure_of(errors):.2f}" for measure_of in measures.values()),
                ]
            reprojected = "" if v.reprojection is None else "yes" if v.reprojection else "no"
            table.add_row(v.model, reprojected, *cells)
        out.print(table)
    out.print()

"""`klab dataset sweep`: how the smoothing window moves the fit."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Sequence
from dataclasses import asdict
from enum import Enum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from koopman_lab.files import writing_where_named
from offboard.terminal import options
from offboard.terminal.needs import needs
from offboard.terminal.output import err, out, progress, show_passed_over

if TYPE_CHECKING:
    from koopman_lab.evaluation.metrics import Errors
    from koopman_lab.evaluation.window_sweep import Entry, SweepRow
    from koopman_lab.koopman.lifted_samples import Estimator


class Estimators(str, Enum):
    """Choices of ``--estimator``."""

    plain = "plain"
    iv = "iv"
    both = "both"


@needs("desk")
def sweep(
    session: Annotated[
        Path, typer.Argument(metavar="SESSION_DIR_OR_LOG", help="Of the dynamic robot.")
    ],
    windows: Annotated[
        str, typer.Option("--windows", metavar="W,W,...", help="In frames, with commas between.")
    ] = "1,10,30,40,50,100",
    dictionary: options.Dictionary = None,
    estimator: Annotated[
        Estimators, typer.Option("--estimator", help="Least squares, instruments, or both.")
    ] = Estimators.plain,
    figure: Annotated[
        Path | None,
        typer.Option("--out", metavar="FILE", help="Draw FILE.pdf and FILE.png, write FILE.csv."),
    ] = None,
    salvage: options.Salvage = False,
    as_json: options.AsJson = False,
) -> None:
    """Show how the smoothing window of the velocities moves the fit.

    Errors are those on every fifth run, which no fit has seen, smoothed with the session's own
    window.

    Example: klab dataset sweep runs/dynamic --windows 1,10,40 --estimator both --out runs/sweep
    """
    from koopman_lab.data.decode import SessionLog
    from koopman_lab.evaluation.window_sweep import known_entries
    from koopman_lab.evaluation.window_sweep import sweep as fits
    from koopman_lab.koopman import dictionary as dictionaries

    window_sizes = options.parse_windows(windows)
    log = SessionLog(session, salvage=salvage)
    config = log.config()
    name = dictionary or config.model.dictionary
    rows = []
    estimators: tuple[Estimator, ...] = (
        ("plain", "iv") if estimator is Estimators.both else (estimator.value,)
    )
    observables = dictionaries.dictionary(name, config.robot.kind).names
    with progress("fitting", "fits") as report:
        for row in fits(log, window_sizes, name, estimators):
            rows.append(row)
            report(len(rows), len(window_sizes) * len(estimators), f"window {row.window}")
    entries = known_entries(config, observables)
    if figure is not None:
        from koopman_lab.figures.window_sweep_figure import draw_sweep

        with writing_where_named(figure):
            draw_sweep(figure, rows, entries)
        err.print(f"figure: {figure.with_suffix('.png')}")
    if as_json:
        facts = {
            "session": str(log.path),
            "dictionary": name,
            "nominal": {entry.name: entry.nominal for entry in entries},
            "windows": [asdict(row) for row in rows],
        }
        out.print_json(json.dumps(facts))
    else:
        for estimator_name in estimators:
            _show(
                f"{name}, {estimator_name}",
                [row for row in rows if row.estimator == estimator_name],
                entries,
            )
    show_passed_over(log.passed_over)


MEASURES: dict[str, Callable[[Errors], float]] = {
    "mean mm": lambda e: 1e3 * e.position_mean_m,
    "largest mm": lambda e: 1e3 * e.position_max_m,
    "mean deg": lambda e: math.degrees(e.angle_mean_rad),
    "largest deg": lambda e: math.degrees(e.angle_max_rad),
}


def _show(name: str, rows: Sequence[SweepRow], entries: Sequence[Entry]) -> None:
    """Print a column for each window; six of them fit into 80 characters."""
    from rich.table import Table

    from koopman_lab.evaluation.window_sweep import STEPS

    fitted = [row for row in rows if row.refused is None]
    out.print(f"{name}, errors on held-out runs")
    table = Table("window (frames)", box=None, pad_edge=False, collapse_padding=True)
    table.add_column("nominal", justify="right")
    for row in fitted:
        table.add_column(str(row.window), justify="right")
    table.add_row("pairs", "", *(str(row.pairs) for row in fitted))
    for entry in entries:
        cells = [f"{(row.entries or {})[entry.name]:.5f}" for row in fitted]
        table.add_row(entry.name, f"{entry.nominal:g}", *cells)
    table.add_row("row of constant", "0", *(f"{row.constant_residual:.0e}" for row in fitted))
    table.add_row("condition", "", *(f"{row.condition:.2f}" for row in fitted))
    for steps, errors in (
        ("1 step", [row.one_step for row in fitted]),
        (f"{STEPS} steps", [row.multi_step for row in fitted]),
    ):
        for label, measure in MEASURES.items():
            cells = ["-" if e is None else f"{measure(e):.2f}" for e in errors]
            table.add_row(f"{steps}, {label}", "0", *cells)
    out.print(table)
    for row in rows:
        if row.refused is not None:
            err.print(f"window {row.window}: {row.refused}")

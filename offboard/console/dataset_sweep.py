"""`klab dataset sweep`: how the smoothing window moves the fit."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from koopman_lab.errors import DataError
from offboard.console import options
from offboard.console.terminal import err, out, progress, show_damage

if TYPE_CHECKING:
    from koopman_lab.koopman.sweep import Entry, SweepRow


def sweep(
    session: Annotated[
        Path, typer.Argument(metavar="SESSION_DIR_OR_LOG", help="Of the dynamic robot.")
    ],
    windows: Annotated[
        str, typer.Option("--windows", metavar="W,W,...", help="In frames, with commas between.")
    ] = "1,10,30,40,50,100",
    dictionary: options.Dictionary = None,
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

    Example: klab dataset sweep runs/dynamic --windows 1,10,40 --out runs/sweep
    """
    from koopman_lab.data.dataset import DataSet
    from koopman_lab.data.decode import SessionLog
    from koopman_lab.koopman import dictionary as dictionaries
    from koopman_lab.koopman.sweep import known_entries
    from koopman_lab.koopman.sweep import sweep as fits

    wanted = parse_windows(windows)
    log = SessionLog(session, salvage=salvage)
    config = log.config()
    name = dictionary or config.model.dictionary
    rows = []
    observables = dictionaries.dictionary(name, config.robot.kind).names
    with progress("fitting") as report:
        for row in fits(log, wanted, name):
            rows.append(row)
            report(len(rows), len(wanted), f"window {row.window}")
    entries = known_entries(DataSet.from_log(log, config), observables)
    if figure is not None:
        from koopman_lab.figures.sweep import draw_sweep

        try:
            draw_sweep(figure, rows, entries)
        except OSError as error:
            raise DataError(
                f"{figure}: cannot be written ({error.strerror}); choose another file with --out"
            ) from None
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
        _show(name, rows, entries)
    show_damage(log.path, log.damage)


def parse_windows(text: str) -> list[int]:
    """Return the windows that a person typed.

    Raises
    ------
    DataError
        If they are no whole numbers above 0.
    """
    try:
        windows = [int(word) for word in text.split(",")]
    except ValueError:
        windows = [0]
    if min(windows) < 1:
        raise DataError(
            f"--windows {text}: whole numbers of frames from 1 on, with commas between them, "
            "for example --windows 1,10,40"
        )
    return windows


def _show(name: str, rows: Sequence[SweepRow], entries: Sequence[Entry]) -> None:
    from rich.table import Table

    table = Table(title=f"{name}; errors on held-out runs, mean / max")
    columns = ["window", "pairs", *(entry.name for entry in entries), "constant", "condition"]
    multi = next((row.multi_step.steps for row in rows if row.multi_step), 0)
    columns += ["1 step (mm)", f"{multi} steps (mm)", f"{multi} steps (deg)"]
    for column in columns:
        table.add_column(column, justify="right")
    nominal = [f"{entry.nominal:g}" for entry in entries]
    table.add_row("nominal", "", *nominal, *[""] * 5)
    for row in rows:
        if row.entries is None:
            table.add_row(str(row.window), str(row.pairs), *["-"] * (len(columns) - 2))
            err.print(f"window {row.window}: {row.refused}")
            continue
        one, many = row.one_step, row.multi_step
        table.add_row(
            str(row.window),
            str(row.pairs),
            *(f"{row.entries[entry.name]:.6f}" for entry in entries),
            f"{row.constant_residual:.1e}",
            f"{row.condition:.3g}",
            f"{1e3 * one.position_mean_m:.2f} / {1e3 * one.position_max_m:.2f}" if one else "-",
            f"{1e3 * many.position_mean_m:.1f} / {1e3 * many.position_max_m:.1f}" if many else "-",
            f"{_deg(many.angle_mean_rad)} / {_deg(many.angle_max_rad)}" if many else "-",
        )
    out.print(table)


def _deg(angle_rad: float) -> str:
    return f"{math.degrees(angle_rad):.2f}"

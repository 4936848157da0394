"""`klab dataset needed`: how many samples a fit needs."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from koopman_lab.errors import ModelError
from koopman_lab.files import writing_where_named
from offboard.terminal import options
from offboard.terminal.needs import needs
from offboard.terminal.output import err, out, progress, show_passed_over

if TYPE_CHECKING:
    from koopman_lab.evaluation.samples_needed import NeededRow


@needs("desk")
def needed(
    source: Annotated[
        Path, typer.Argument(metavar="SOURCE", help="A session, or a data set .npz of one.")
    ],
    repetitions: Annotated[
        int, typer.Option("--repetitions", min=1, help="Draws for each number of samples.")
    ] = 20,
    seed: Annotated[int, typer.Option("--seed", min=0, help="Of the draws.")] = 0,
    dictionary: options.Dictionary = None,
    window: options.Window = None,
    figure: Annotated[
        Path | None,
        typer.Option("--out", metavar="FILE", help="Draw FILE.pdf and FILE.png, write FILE.csv."),
    ] = None,
    salvage: options.Salvage = False,
    as_json: options.AsJson = False,
) -> None:
    """Show errors against the number of samples, for plain, noise-aware and symmetric fits.

    Samples are drawn across runs; bands are those of a bootstrap of the runs.

    Example: klab dataset needed runs/dynamic --repetitions 20 --out runs/needed
    """
    from koopman_lab.data.source import open_source
    from koopman_lab.evaluation import samples_needed as study
    from koopman_lab.koopman.symmetry import equivariant_basis
    from koopman_lab.koopman.trainer import resolve

    opened = open_source(source, window=window, salvage=salvage)
    resolved = resolve(dictionary or opened.dictionary, opened.dataset)
    methods = list(study.METHODS)
    try:
        equivariant_basis(resolved)
    except ModelError as error:
        err.print(f"without symmetric fits: {error}")
        methods = [name for name in methods if not study.METHODS[name].symmetric]
    counts = study.counts_of(opened.dataset)
    rows = []
    with progress("fitting", "fits") as report:
        for row in study.errors_by_count(
            opened.dataset, resolved, counts, repetitions, methods=methods, seed=seed
        ):
            rows.append(row)
            report(len(rows), len(counts) * len(methods), f"{row.method}, {row.count} samples")
    if figure is not None:
        from koopman_lab.figures.samples_needed_figure import draw_needed

        with writing_where_named(figure):
            draw_needed(figure, rows)
        err.print(f"figure: {figure.with_suffix('.png')}")
    if as_json:
        facts = {
            "source": str(opened.file),
            "dictionary": resolved.name,
            "steps": study.STEPS,
            "percentiles": study.BAND,
            "rows": [asdict(row) for row in rows],
        }
        out.print_json(json.dumps(facts))
    else:
        _show(resolved.name, rows)
    show_passed_over(opened.passed_over)


def _show(name: str, rows: Sequence[NeededRow]) -> None:
    from rich.table import Table

    from koopman_lab.evaluation.samples_needed import STEPS

    table = Table(
        "fit", title=f"{name}: mean error after {STEPS} steps, median (5 to 95 %)", box=None
    )
    for column in ("samples", "refused", "mm", "deg"):
        table.add_column(column, justify="right")
    for row in rows:
        table.add_row(
            row.method,
            str(row.count),
            f"{row.refused} of {row.repetitions}",
            _band(row.position_m, 1e3),
            _band(row.angle_rad, math.degrees(1.0)),
        )
    out.print(table)


def _band(band: tuple[float, float, float] | None, factor: float) -> str:
    if band is None:
        return "-"
    low, middle, high = (factor * value for value in band)
    return f"{middle:.3g} ({low:.3g} to {high:.3g})"

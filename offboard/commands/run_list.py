"""`klab runs`: what was run, a line each."""

from __future__ import annotations

import json
import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from offboard.terminal import options
from offboard.terminal.output import err, out
from offboard.terminal.visible_text import one_line

if TYPE_CHECKING:
    from offboard.lab.run_history import PastRun

RUNS = Path("runs")


def runs(
    folder: Annotated[
        Path, typer.Argument(metavar="DIR", help="Folder with run folders in it.")
    ] = RUNS,
    last: Annotated[
        int | None, typer.Option("--last", min=1, help="Only so many, the newest.")
    ] = None,
    as_json: options.AsJson = False,
) -> None:
    """List what was run, the newest last: when, what, with which model, where, how it ended.

    What has no summary ended before its time, or is still under way.

    Example: klab runs --last 10
    """
    from rich.cells import cell_len, set_cell_size

    from koopman_lab.errors import DataError
    from offboard.lab.run_history import RunHistory

    if not folder.is_dir():
        raise DataError(
            f"{folder}: no such folder; runs are kept in {RUNS} of the folder where klab is "
            "started, or name another"
        )
    past, _ = RunHistory(folder).look()
    past = past[:last][::-1]
    if as_json:
        out.print_json(json.dumps([_facts(run) for run in past]))
        return
    if not past:
        err.print(f"{folder}: no run yet; `klab demo` makes the first one")
    rows = [_row(run) for run in past]
    widths = [max(map(cell_len, column)) for column in zip(*rows, strict=True)]
    for row in rows:
        cells = [set_cell_size(cell, width) for cell, width in zip(row, widths, strict=True)]
        out.print("  ".join(cells).rstrip())


def _row(run: PastRun) -> list[str]:
    """Return when, what, with which model, where, and how it ended."""
    model = Path(run.uses["model"]).name if "model" in run.uses else "-"
    detail = f" ({run.outcome.detail})" if run.outcome.detail else ""
    cells = (_when(run), run.what or "-", model, str(run.folder), f"{run.outcome.word}{detail}")
    return [one_line(cell) for cell in cells]


def _facts(run: PastRun) -> dict[str, object]:
    return {
        "when": time.strftime("%Y-%m-%dT%H:%M:%S%z", time.localtime(run.at_s)),
        "what": run.what,
        "robot": run.robot,
        "outcome": run.outcome.word,
        "detail": run.outcome.detail,
        "folder": str(run.folder),
        "log": run.log,
        "used": run.uses,
    }


def _when(run: PastRun) -> str:
    return time.strftime("%Y-%m-%d %H:%M", time.localtime(run.at_s))

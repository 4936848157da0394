"""`klab reproduce`: every number and figure of the paper, from nothing."""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from koopman_lab.errors import UsageError
from koopman_lab.files import write_json
from offboard.lab.run_folder import run_path
from offboard.terminal import options
from offboard.terminal.needs import needs
from offboard.terminal.output import err, out

if TYPE_CHECKING:
    from offboard.reproduction.paper.claim import JudgedClaim

REQUEST = "reproduction.json"
"""What the folder is of: the reproduction that --resume goes on with."""


@needs("desk")
def reproduce(
    quick: Annotated[
        bool,
        typer.Option("--quick", help="Fewer segments, runs and starts: minutes, not hours."),
    ] = False,
    folder: options.Out = None,
    resume: Annotated[
        bool, typer.Option("--resume", help="Go on with what was begun in DIR.")
    ] = False,
    workers: Annotated[
        int | None, typer.Option("--workers", min=1, help="Processes at once; default: all cores.")
    ] = None,
    seed: Annotated[int, typer.Option("--seed", min=0, help="Of draws, noise and starts.")] = 1,
    only: Annotated[
        list[str] | None,
        typer.Option(
            "--only", metavar="STEP", help="This step and those it needs; may be given repeatedly."
        ),
    ] = None,
) -> None:
    """Calibrate, train, validate, drive, simulate and study both robots, and judge the paper.

    Each step is a klab command on virtual time, with a folder in DIR. DIR gets report.md and
    report.html: each claim of the paper beside our numbers, with a verdict computed from them,
    every figure, and the commands. What is interrupted goes on with --resume, and so does what
    began with --only, without it.

    Example: klab reproduce --quick --out runs/reproduction
    """
    from offboard.reproduction.paper.claim import judge
    from offboard.reproduction.paper.claims import CLAIMS
    from offboard.reproduction.paper.report import Facts, tally, write_report
    from offboard.reproduction.paper.settings import SETTINGS
    from offboard.reproduction.paper.step_results import StepResults
    from offboard.reproduction.paper.verdict import Verdict
    from offboard.reproduction.step_runner import finished, run, with_needs
    from offboard.reproduction.steps import FULL, QUICK, judged_steps, steps

    base = run_path(folder, "reproduction")
    size = QUICK if quick else FULL
    all_steps = steps(size, seed)
    # The verdicts do not wait for the studies that the paper does not have.
    parts = [with_needs(all_steps, only)] if only else [judged_steps(size, seed), all_steps]
    _open_folder(base, {"quick": quick, "seed": seed}, resume=resume)
    cores = len(os.sched_getaffinity(0))
    for part in parts:
        run(base, part, workers or cores, _print_line)
        records = finished(base, all_steps)
        results = StepResults(base)
        judged = [judge(claim, results) for claim in CLAIMS]
        settings = [judge(setting, results) for setting in SETTINGS]
        write_report(base, Facts(quick, size.in_words, seed, records), judged, settings)
        _print_line(f"report: {base / 'report.html'} and report.md")
    _show([j for j in judged if not only or j.verdict is not Verdict.UNKNOWN])
    out.print(tally(judged))


def _print_line(line: str) -> None:
    err.print(line)


def _open_folder(base: Path, request: dict[str, Any], *, resume: bool) -> None:
    """Make the folder, or see that it is one to go on with.

    Raises
    ------
    UsageError
        If it holds something else, or cannot be written.
    """
    file = base / REQUEST
    try:
        before = json.loads(file.read_text()) if file.exists() else None
        if before is None:
            if base.exists() and any(base.iterdir()):
                raise UsageError(f"{base}: holds something else; choose another folder with --out")
            write_json(file, request)
            return
    except (OSError, ValueError) as error:
        raise UsageError(
            f"{file}: cannot be used ({error}); choose another folder with --out"
        ) from None
    if not resume:
        raise UsageError(
            f"{base}: holds a reproduction; go on with it by --resume, or choose another folder "
            "with --out"
        )
    if not isinstance(before, dict):
        raise UsageError(f"{file}: cannot be used (no table); choose another folder with --out")
    if before != request:
        size = "with" if before.get("quick") else "without"
        raise UsageError(
            f"{base}: was begun {size} --quick and with --seed {before.get('seed')}; go on with "
            "the same, or choose another folder with --out"
        )


def _show(judged: Sequence[JudgedClaim]) -> None:
    from rich.table import Table

    table = Table("section", "claim", "here", "verdict", box=None, pad_edge=False)
    for j in judged:
        table.add_row(j.claim.section, j.claim.name, "\n".join(j.numbers), j.verdict.value)
    out.print(table)

"""`klab bench flood`: the lab under a flood of mutated datagrams."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from offboard.terminal import options
from offboard.terminal.exit_codes import ExitCode
from offboard.terminal.output import err, out

if TYPE_CHECKING:
    from koopman_lab.config.schema import LabConfig
    from offboard.bench.flooded_lab import Row


def flood(
    config: options.ConfigFile = None,
    overrides: options.Overrides = None,
    robot: options.Robot = None,
    minutes: Annotated[
        float, typer.Option("--minutes", min=0.05, max=60.0, help="How long to drive, each time.")
    ] = 1.0,
    heard_share: Annotated[
        float,
        typer.Option(
            "--heard-share", min=0.0, max=1.0, help="Of the flood, what is on channels of the lab."
        ),
    ] = 0.1,
    url: options.Url = None,
    folder: options.Out = None,
    as_json: options.AsJson = False,
) -> None:
    """Drive a lab under a flood of mutated datagrams, and without it; count deaths and losses.

    Plant, motor loop, logger and a calibration run; the flood is as fast as one process can send,
    and stays within this machine. Some of it is on channels of the lab, but no message.

    Example: klab bench flood --minutes 10
    """
    from offboard.bench.driven_lab import MORE_THAN_ENOUGH, NO_RADIO_LOSS
    from offboard.bench.flooded_lab import FLOODED, QUIET, as_table
    from offboard.lab.run_folder import run_path

    changes = [MORE_THAN_ENOUGH, *NO_RADIO_LOSS]
    lab = options.resolve(config, [*changes, *(overrides or ())], robot, url=url)
    path = run_path(folder, "flood")
    rows = {
        QUIET: _drive(lab, path / "quiet", minutes, None),
        FLOODED: _drive(lab, path / "flooded", minutes, heard_share),
    }
    if as_json:
        out.print_json(json.dumps({name: row._asdict() for name, row in rows.items()}))
    else:
        out.print(as_table(rows, lab.mocap.rate_hz, 60.0 * minutes))
    if any(row.death for row in rows.values()):
        raise typer.Exit(ExitCode.NO)


def _drive(lab: LabConfig, path: Path, minutes: float, heard_share: float | None) -> Row:
    from offboard.bench.driven_lab import driven_lab
    from offboard.bench.flooded_lab import measure

    with driven_lab("flood", lab, path, minutes, f"driving, {path.name}") as driven:
        if fault := driven.listener.filter_fault():
            err.print(f"no filter keeps hostile datagrams off: {fault}")
        return measure(driven, heard_share)

"""`klab rerun`: one node once more on its recorded inputs, to see whether it says the same."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from koopman_lab.errors import ConfigError
from offboard.terminal import options
from offboard.terminal.choices import name_option
from offboard.terminal.exit_codes import ExitCode
from offboard.terminal.needs import needs
from offboard.terminal.output import err, out, progress, show_unreadable

if TYPE_CHECKING:
    from koopman_lab.replay.output_comparison import Agreement, Difference

SHOWN = 10
"""Differences printed."""
REAL_TIME_TOLERANCE = 0.05
"""In the units of each field: a tick can have seen one camera frame more or less."""

REAL_TIME_SHARE = 0.5
"""Of the messages that must agree: one tick's difference is soon forgotten, another node is not."""


def _nodes() -> list[str]:
    """Return the choices of ``--node``: those that the table of processes can build again."""
    from koopman_lab.bus.processes import in_stop_order

    return [row.name for row in in_stop_order() if row.rebuild]


@needs("desk", "--node controller", lambda options: options["node"] == "controller")
def rerun(
    log: Annotated[Path, typer.Argument(metavar="LOG", help="A log, or its run folder.")],
    node: Annotated[str, name_option("--node", "recorded node", _nodes, "Which one runs again.")],
    model: Annotated[
        Path | None,
        typer.Option("--model", metavar="FILE", help="For the controller: the model of the run."),
    ] = None,
    config: Annotated[
        Path | None,
        typer.Option(
            "--config", metavar="FILE", help="In place of the configuration that the log says."
        ),
    ] = None,
    tolerance: Annotated[
        float | None,
        typer.Option(
            "--tolerance",
            min=0.0,
            metavar="X",
            help="By how much numbers may differ; default 0, for a log in real time 0.05.",
        ),
    ] = None,
    robot_name: options.RobotsName = None,
    salvage: Annotated[
        bool, typer.Option("--salvage", help="Use every intact event of a damaged log.")
    ] = False,
    as_json: options.AsJson = False,
) -> None:
    """Feed a node its recorded inputs on virtual time and compare what it says with the record.

    A log of --lockstep must come out equal byte by byte (exit code 1 if not). In real time nobody
    wrote down when each tick was run, so only most messages come out about the same.

    Example: klab rerun runs/calibration --node sampler
    """
    from koopman_lab.bus.processes import PROCESSES
    from koopman_lab.data.decode import SessionLog
    from koopman_lab.replay.node_rerun import rerun as run_again
    from koopman_lab.replay.output_comparison import compare
    from koopman_lab.replay.recorded_process import recorded_process
    from koopman_lab.replay.rotated_log import read_rotated_log

    session = SessionLog(log, robot_name=robot_name, salvage=salvage)
    lab = session.config() if config is None else options.resolve(config, None, None)
    if lab.robot.name != session.robot_name:
        raise ConfigError(
            f"{config or session.path}: configures {lab.robot.name}, but the log is of "
            f"{session.robot_name}"
        )
    events = read_rotated_log(session.path, salvage=salvage)
    process = recorded_process(node, lab, events)
    duration_s = round(session.duration_s)
    rebuilt = PROCESSES.load(node, PROCESSES.get(node).rebuild)(lab, session, model)
    with progress("running again", "s") as report:
        outputs = run_again(
            rebuilt, lab, events, process, lambda s: report(s - process.start_us * 1e-6, duration_s)
        )
    if tolerance is None:
        tolerance = 0.0 if process.virtual else REAL_TIME_TOLERANCE
    agreements = compare(
        outputs.recorded,
        outputs.again,
        outputs.end_us,
        tolerance=tolerance,
        in_real_time=not process.virtual,
    )
    facts = {
        "file": str(session.path),
        "node": node,
        "lockstep": process.virtual,
        "tolerance": tolerance,
        "share": _share(agreements),
    }
    if as_json:
        out.print_json(json.dumps(facts | _as_json(agreements)))
    else:
        _show(facts, agreements)
    show_unreadable(session.path, outputs.passed_over)
    least = 1.0 if process.virtual else REAL_TIME_SHARE
    if _share(agreements) < least:
        raise typer.Exit(ExitCode.NO)


def _as_json(agreements: dict[str, Agreement]) -> dict[str, Any]:
    counts = ("equal", "different", "missing", "extra", "beyond")
    channels = {
        name: {count: getattr(a, count) for count in counts} | {"largest": a.largest}
        for name, a in agreements.items()
    }
    totals = {count: sum(getattr(a, count) for a in agreements.values()) for count in counts}
    return totals | {
        "channels": channels,
        "differences": [
            {
                "channel": d.channel,
                "number": d.number,
                "at_us": d.at_us,
                "fields": {f.name: [_plain(f.recorded), _plain(f.again)] for f in d.fields},
            }
            for d in _first_differences(agreements)
        ],
    }


def _show(facts: dict[str, Any], agreements: dict[str, Agreement]) -> None:
    from rich.table import Table

    mode = "lockstep" if facts["lockstep"] else "real time"
    table = Table(
        title=f"{facts['node']} again, {facts['file']} ({mode}), tolerance {facts['tolerance']:g}"
    )
    for column in ("channel", "equal", "different", "missing", "extra", "largest difference"):
        table.add_column(column, justify="left" if column == "channel" else "right")
    for name, a in agreements.items():
        field = max(a.largest, key=a.largest.__getitem__, default=None)
        largest = "-" if field is None else f"{field} {a.largest[field]:.3g}"
        table.add_row(name, *map(str, (a.equal, a.different, a.missing, a.extra)), largest)
    out.print(table)
    out.print(f"{_share(agreements):.1%} of the messages agree")
    differences = _first_differences(agreements)
    for d in differences:
        fields = "; ".join(f"{f.name} {_plain(f.recorded)} -> {_plain(f.again)}" for f in d.fields)
        out.print(f"{d.channel} number {d.number} at {d.at_us * 1e-6:.6f} s: {fields}")
    more = sum(a.different for a in agreements.values()) - len(differences)
    if more:
        out.print(f"and {more} more messages that differ")
    beyond = sum(a.beyond for a in agreements.values())
    if beyond:
        err.print(f"{beyond} messages at or after the log's last time are not counted")


def _share(agreements: dict[str, Agreement]) -> float:
    """Return which share of all messages agrees."""
    equal = sum(a.equal for a in agreements.values())
    others = sum(a.different + a.missing + a.extra for a in agreements.values())
    return equal / (equal + others) if equal + others else 1.0


def _first_differences(agreements: dict[str, Agreement]) -> list[Difference]:
    differences = [d for a in agreements.values() for d in a.differences]
    return sorted(differences, key=lambda d: d.at_us)[:SHOWN]


def _plain(value: object) -> object:
    return value if isinstance(value, (int, float, bool)) else str(value)

"""`klab log`: look into session logs."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from koopman_lab.errors import LogError
from offboard.commands.log_export import export, plot
from offboard.commands.log_import import import_
from offboard.terminal import options
from offboard.terminal.choices import Commands
from offboard.terminal.exit_codes import ExitCode
from offboard.terminal.output import err, out, show_unreadable
from offboard.terminal.visible_text import one_line

if TYPE_CHECKING:
    from koopman_lab.data.channel_summary import ChannelSummary

SHOWN = 10
"""Damaged places listed one by one."""

app = Commands(help="Look into session logs.", no_args_is_help=True)


@app.command()
def info(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="A log, or its run folder.")],
    channel: Annotated[
        list[str] | None, typer.Option("--channel", metavar="NAME", help="Only this channel.")
    ] = None,
    salvage: Annotated[
        bool, typer.Option("--salvage", help="Use every intact event of a damaged log.")
    ] = False,
    as_json: options.AsJson = False,
) -> None:
    """Show channels, counts, rates, gaps and duration of a log, and where two spoke at once.

    Example: klab log info runs/calibration/session.lcm --channel R1_MOCAP_POSE
    """
    from koopman_lab.data.decode import SessionLog

    log = SessionLog(file, salvage=salvage)
    for name in channel or ():
        if name not in log.channels:
            raise LogError(f"{log.path}: no channel {name}; there are: {', '.join(log.channels)}")
    rows = {n: c for n, c in log.channels.items() if not channel or n in channel}
    skipped = sum(d.size for d in log.damage)
    skipped_s = sum(d.duration_s or 0.0 for d in log.damage)
    if as_json:
        facts = {
            "file": str(log.path),
            "duration_s": log.duration_s,
            "events": sum(c.count for c in log.channels.values()),
            "skipped_bytes": skipped,
            "skipped_s": skipped_s,
            "damage": [asdict(d) for d in log.damage],
            "channels": {name: asdict(c) for name, c in rows.items()},
        }
        out.print_json(json.dumps(facts))
        return
    from rich.table import Table

    table = Table(title=f"{log.path}, {log.duration_s:.1f} s")
    for column in ("channel", "count", "rate (Hz)", "lost", "gaps"):
        table.add_column(column, justify="left" if column == "channel" else "right")
    for name, c in rows.items():
        rate = "-" if c.rate_hz is None else f"{c.rate_hz:.2f}"
        table.add_row(one_line(name), str(c.count), rate, str(c.lost), str(c.gaps))
    out.print(table)
    for line in _identity_lines(rows):
        err.print(one_line(line))
    show_unreadable(log.path, log.passed_over.unreadable)
    for stretch in log.damage[:SHOWN]:
        err.print(f"damaged, passed over: {stretch}")
    if log.damage:
        err.print(
            f"{skipped} damaged bytes passed over in {len(log.damage)} places, {skipped_s:.3f} s"
        )


@app.command()
def verify(
    file: Annotated[Path, typer.Argument(metavar="RUN", help="A run folder, or its log.")],
    as_json: options.AsJson = False,
) -> None:
    """Say whether the log of a finished session is as it was: its summary holds the SHA-256.

    Exit code 0 if it is, 1 if a bit of it changed, 2 if nothing tells.

    Example: klab log verify runs/calibration
    """
    from koopman_lab.eventlog.seal import changes

    changed = changes(file)
    if as_json:
        out.print_json(json.dumps({"file": str(file), "changed": changed}))
    else:
        for line in changed:
            err.print(f"changed: {one_line(line)}")
        if not changed:
            out.print(f"ok: {file} is as the session left it")
    if changed:
        raise typer.Exit(ExitCode.NO)


def _identity_lines(rows: Mapping[str, ChannelSummary]) -> list[str]:
    """Return on which channels more spoke than one, or numbers did not count."""
    from koopman_lab.bus.channels import split_name
    from koopman_lab.bus.publishers import NamedIdentity, identity_faults

    return identity_faults(
        NamedIdentity(name, split_name(name)[1], summary.identity, summary.rate_hz)
        for name, summary in rows.items()
        if not summary.identity.clear
    )


app.command()(plot)
app.command()(export)
app.command("import")(import_)

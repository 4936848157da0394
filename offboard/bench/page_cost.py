"""`klab bench view`: what the page costs, how late it is, and whether clients disturb the lab."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Annotated

import typer

from offboard.terminal import options
from offboard.terminal.needs import needs
from offboard.terminal.output import err, out

if TYPE_CHECKING:
    from rich.table import Table

    from offboard.bench.page_load import Load


@needs("desk")
def view(
    config: options.ConfigFile = None,
    overrides: options.Overrides = None,
    robot: options.Robot = None,
    minutes: Annotated[
        float, typer.Option("--minutes", min=0.1, help="How long to measure.")
    ] = 10.0,
    clients: Annotated[
        int,
        typer.Option("--clients", min=2, max=32, help="Pages; one of them is stopped by SIGSTOP."),
    ] = 10,
    url: options.Url = None,
    folder: options.Out = None,
    as_json: options.AsJson = False,
) -> None:
    """Serve the page to many clients during a calibration: CPU, memory, delay, lost messages.

    One client is stopped like a machine that hangs. With Chromium and the package playwright one
    is a real page, and shows how long a camera frame takes to the screen.

    Example: klab bench view --minutes 1 --clients 4
    """
    from offboard.bench.driven_lab import MORE_THAN_ENOUGH, NO_RADIO_LOSS, driven_lab
    from offboard.bench.page_load import measure

    changes = [MORE_THAN_ENOUGH, *NO_RADIO_LOSS, *(overrides or ())]
    lab = options.resolve(config, changes, robot, url=url)
    with driven_lab("view", lab, folder, minutes, "showing") as driven:
        load = measure(driven, clients)
    if as_json:
        out.print_json(json.dumps(load._asdict()))
        return
    if load.drawn_ms is None:
        err.print("no Chromium or no playwright: nobody drew the page")
    out.print(_table(load, driven.seconds))


def _table(load: Load, seconds: float) -> Table:
    from rich.table import Table

    table = Table("", "", title=f"klab view for {seconds:.0f} s")
    table.add_row("server", f"{100.0 * load.cpu_share:.2f} % of a core")
    low, high = min(load.memory_mb[1:] or load.memory_mb), max(load.memory_mb)
    table.add_row("its memory", f"{low:.1f} to {high:.1f} MB, at last {load.memory_mb[-1]:.1f} MB")
    for what, spread in (
        ("camera exposure to next picture", load.drawn_ms),
        ("snapshot made to client", load.snapshot_ms),
    ):
        if spread is not None:
            p50, p99, longest = spread
            table.add_row(what, f"p50 {p50:.0f}, p99 {p99:.0f}, max {longest:.0f} ms")
    table.add_row("snapshots a second, least of all clients", f"{load.snapshots_hz:.1f}")
    table.add_row("messages of the lab, lost", f"{load.messages}, {load.lost}")
    table.add_row("ticks of the motor loop, missed", f"{load.ticks}, {load.missed_ticks}")
    return table

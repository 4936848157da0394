"""`klab status`: which processes are there."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import typer

from offboard.commands.topics import spin_for
from offboard.terminal import options
from offboard.terminal.exit_codes import ExitCode
from offboard.terminal.output import err, out
from offboard.terminal.visible_text import one_line

if TYPE_CHECKING:
    from koopman_lab.bus.realtime import Listener
    from koopman_lab.config.schema import LabConfig
    from offboard.monitor.lab_view import LabView
    from offboard.monitor.process_states import ProcessState


def status(
    config: options.ConfigFile = None,
    overrides: options.Overrides = None,
    url: options.Url = None,
    as_json: options.AsJson = False,
) -> None:
    """Show the processes of every robot on the bus: state, needs, who may stop them.

    What died stays in the table, with the last lines of its log, until a lab is started again. A
    line each says where two programs use the name of one robot. The exit code is 1 then, and where
    a process is silent or died, or none is there.

    Example: klab status
    """
    from offboard.lab.process_notes import broken_labs, with_broken_labs

    lab = options.resolve(config, overrides, None, url=url)
    listener, view = listen_to_all(lab)
    now_us = listener.now_us()
    live = {name: robot for name, robot in view.robots.items() if not robot.replayed(now_us)}
    processes = {name: robot.entries(now_us) for name, robot in live.items()}
    if not any(processes.values()):
        err.print(f"no process heard on {lab.bus.url}; `klab up` starts a lab")
    processes = with_broken_labs(processes, broken_labs(lab.bus.url, now_us))
    if as_json:
        from offboard.monitor.json_values import process_row

        rows = {
            name: [process_row(e) for e in entries] for name, entries in sorted(processes.items())
        }
        out.print_json(json.dumps(rows))
    else:
        _show(processes)
    refused = view.refusals(now_us)
    if refused:
        err.print(one_line(refused))
    doubts = [line for name in sorted(live) for line in live[name].identity_lines(now_us)]
    for line in doubts:
        err.print(one_line(line))
    entries = [entry for entries in processes.values() for entry in entries]
    if doubts or not entries or any(entry.state in ("silent", "died") for entry in entries):
        raise typer.Exit(ExitCode.NO)


def listen_to_all(lab: LabConfig) -> tuple[Listener, LabView]:
    """Listen for as long as it takes to hear everybody."""
    from offboard.lab.present_nodes import LISTEN_S
    from offboard.monitor.lab_view import LabView

    listener, view = options.listen(lab), LabView(lab)
    listener.overhear(view.take, view.refuse)
    spin_for(listener, LISTEN_S)
    return listener, view


def _show(processes: dict[str, list[ProcessState]]) -> None:
    from rich.table import Table

    from offboard.monitor.process_states import DIED

    if not any(processes.values()):
        return
    table = Table()
    for column in ("robot", "process", "state", "pid", "heard (s)", "needs", "who may stop it"):
        table.add_column(column)
    for robot, entries in sorted(processes.items()):
        for e in entries:
            ended = f": {e.report.ended}" if e.report is not None and e.report.ended else ""
            needs = ", ".join(e.needs) or "nothing"
            heard = "-" if e.age_s is None else f"{e.age_s:.1f}"
            state = one_line(e.state + ended)
            row = (e.name, state, str(e.pid), heard, needs, e.stopped_by)
            table.add_row(one_line(robot), *row)
    out.print(table)
    for robot, entries in sorted(processes.items()):
        for e in entries:
            if e.report is not None and e.state == DIED:
                out.print(one_line(f"{robot} {e.name}: {e.report.log_file} ends with:"))
                out.print(e.report.last_lines.expandtabs() or "(it said nothing)")

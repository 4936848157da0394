"""`klab status` and `klab down`: which processes are there, and how to end them."""

from __future__ import annotations

import contextlib
import json
import os
import signal
import socket
from typing import TYPE_CHECKING

import typer

from offboard.console import options
from offboard.console.terminal import err, out
from offboard.console.topics import spin_for

if TYPE_CHECKING:
    from koopman_lab.bus.realtime import Listener
    from koopman_lab.config.schema import LabConfig
    from offboard.viewer.roll import Entry
    from offboard.viewer.state import LabView

END_LIMIT_S = 60.0
"""Seven processes that all ignore SIGINT and SIGTERM take 42 s."""


def status(
    config: options.ConfigFile = None,
    overrides: options.Overrides = None,
    url: options.Url = None,
    as_json: options.AsJson = False,
) -> None:
    """Show the processes of every robot on the bus: state, needs, who may stop them.

    What died stays in the table, with the last lines of its log, until a lab is started again. The
    exit code is 1 where one is silent or died, or none is there.

    Example: klab status
    """
    from offboard.console.notes import broken, with_broken

    lab = options.resolve(config, overrides, None, url=url)
    listener, view = _heard(lab)
    now_us = listener.now_us()
    found = {
        name: robot.entries(now_us)
        for name, robot in view.robots.items()
        if not robot.replayed(now_us)
    }
    if not any(found.values()):
        err.print(f"no process heard on {lab.bus.url}; `klab up` starts a lab")
    found = with_broken(found, broken(lab.bus.url, now_us))
    if as_json:
        from offboard.viewer.json_values import entry_row

        rows = {name: [entry_row(e) for e in entries] for name, entries in sorted(found.items())}
        out.print_json(json.dumps(rows))
    else:
        _show(found)
    if any(e.state in ("silent", "died") for entries in found.values() for e in entries) or not any(
        found.values()
    ):
        raise typer.Exit(1)


def down(
    config: options.ConfigFile = None,
    overrides: options.Overrides = None,
    robot_name: options.RobotsName = None,
    url: options.Url = None,
) -> None:
    """End the commands of this machine that run processes of a robot, as Ctrl-C in each would.

    Example: klab down --robot-name R2
    """
    from koopman_lab.errors import LabStateError
    from offboard.console.notes import alive, is_klab

    lab = options.resolve(config, overrides, None, url=url, robot_name=robot_name)
    listener, view = _heard(lab)
    robot = view.robots.get(lab.robot.name)
    entries = [] if robot is None else robot.entries(listener.now_us())
    told = [e.told for e in entries if e.told is not None and e.told.state == e.told.RUNNING]
    here = {
        t.supervisor_pid
        for t in told
        if t.host == socket.gethostname() and is_klab(t.supervisor_pid)
    }
    elsewhere = {t.host for t in told} - {socket.gethostname()}
    if elsewhere:
        err.print(f"{lab.robot.name} has processes on {', '.join(sorted(elsewhere))} as well")
    if not here:
        by_hand = [e.name for e in entries if e.told is None and e.state == "alive"]
        hint = f"; {', '.join(by_hand)}: started by hand, end them there" if by_hand else ""
        raise LabStateError(
            f"{lab.robot.name}: no `klab up`, `calibrate` or `park` of this machine runs on "
            f"{lab.bus.url}{hint}"
        )
    for pid in here:
        with contextlib.suppress(ProcessLookupError):
            os.kill(pid, signal.SIGINT)
    spin_for(listener, END_LIMIT_S, lambda: not any(map(alive, here)))
    left = sorted(filter(alive, here))
    if left:
        raise LabStateError(f"{lab.robot.name}: still running: process {', '.join(map(str, left))}")
    err.print(f"{lab.robot.name} is down")


def _heard(lab: LabConfig) -> tuple[Listener, LabView]:
    """Listen for as long as it takes to hear everybody."""
    from offboard.console.supervisor import LISTEN_S
    from offboard.viewer.state import LabView

    listener, view = options.listen(lab), LabView(lab)
    listener.overhear(view.take)
    spin_for(listener, LISTEN_S)
    return listener, view


def _show(found: dict[str, list[Entry]]) -> None:
    from rich.table import Table

    from offboard.viewer.roll import DIED

    if not any(found.values()):
        return
    table = Table()
    for column in ("robot", "process", "state", "pid", "heard (s)", "needs", "who may stop it"):
        table.add_column(column)
    for robot, entries in sorted(found.items()):
        for e in entries:
            ended = f": {e.told.ended}" if e.told is not None and e.told.ended else ""
            needs = ", ".join(e.needs) or "nothing"
            heard = "-" if e.age_s is None else f"{e.age_s:.1f}"
            table.add_row(robot, e.name, e.state + ended, str(e.pid), heard, needs, e.stopped_by)
    out.print(table)
    for robot, entries in sorted(found.items()):
        for e in entries:
            if e.told is not None and e.state == DIED:
                out.print(f"{robot} {e.name}: {e.told.log_file} ends with:", markup=False)
                out.print(e.told.last_lines or "(it said nothing)", markup=False)

"""`klab status` and `klab down`: which processes are there, and how to end them."""

from __future__ import annotations

import contextlib
import json
import os
import signal
import socket
from typing import TYPE_CHECKING

import typer

from offboard.commands.topics import spin_for
from offboard.terminal import options
from offboard.terminal.output import err, out

if TYPE_CHECKING:
    from koopman_lab.bus.realtime import Listener
    from koopman_lab.config.schema import LabConfig
    from offboard.monitor.lab_view import LabView
    from offboard.monitor.process_states import ProcessState

END_LIMIT_S = 60.0
"""Seven processes that all ignore SIGINT and SIGTERM take 42 s."""


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
    listener, view = _listen(lab)
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
    doubts = [line for name in sorted(live) for line in live[name].identity_lines(now_us)]
    for line in doubts:
        err.print(line)
    entries = [entry for entries in processes.values() for entry in entries]
    if doubts or not entries or any(entry.state in ("silent", "died") for entry in entries):
        raise typer.Exit(1)


def down(
    config: options.ConfigFile = None,
    overrides: options.Overrides = None,
    robot_name: options.RobotsName = None,
    url: options.Url = None,
) -> None:
    """End the commands of this machine that run processes of a robot, as Ctrl-C in each would.

    Who commands the robot is ended first, and the others when it stands. What goes on, because
    another machine or a person started it, is named; the exit code is then 1.

    Example: klab down --robot-name R2
    """
    from koopman_lab.bus.processes import commanders, process
    from koopman_lab.errors import LabStateError
    from offboard.lab.child_process import KILLED, PATIENCE_S
    from offboard.lab.process_notes import alive, running_commands
    from offboard.monitor.process_states import SILENT_S

    lab = options.resolve(config, overrides, None, url=url, robot_name=robot_name)
    name = lab.robot.name
    # Before anything is heard, which takes a second: meanwhile the robot would drive on.
    noted = running_commands(lab)
    commanding = {pid for pid, names in noted.items() if names & commanders()}
    _interrupt(commanding)
    listener, view = _listen(lab)
    entries = _entries(view, name, listener)
    ours = [e for e in entries if _started_here(e) and e.state not in ("finished", "died")]
    supervisors = set(noted) | {e.report.supervisor_pid for e in ours if e.report is not None}
    others = _others_text(entries, supervisors)
    if not supervisors:
        hint = f"; still there: {others}" if others else ""
        raise LabStateError(
            f"{name}: no `klab up`, `calibrate` or `park` of this machine runs on "
            f"{lab.bus.url}{hint}"
        )
    late = {
        e.report.supervisor_pid for e in ours if e.report and process(e.name).commands
    } - commanding
    _interrupt(late)
    if commanding or late:
        spin_for(listener, PATIENCE_S, lambda: _stands(view, name, listener))
    _interrupt(supervisors - commanding - late)
    spin_for(listener, END_LIMIT_S, lambda: not any(map(alive, supervisors)))
    left = sorted(filter(alive, supervisors))
    if left:
        raise LabStateError(f"{name}: still running: process {', '.join(map(str, left))}")
    for e in _entries(view, name, listener):
        if e.report is not None and e.report.ended == KILLED:
            err.print(f"{e.name} (process {e.pid}) did not end by itself: {KILLED}")
    if others:
        spin_for(listener, SILENT_S)
        others = _others_text(_entries(view, name, listener), supervisors)
    if others:
        err.print(f"{name} is not down; still there: {others}")
        raise typer.Exit(1)
    err.print(f"{name} is down")


def _interrupt(pids: set[int]) -> None:
    for pid in pids:
        with contextlib.suppress(ProcessLookupError):
            os.kill(pid, signal.SIGINT)


def _entries(view: LabView, name: str, listener: Listener) -> list[ProcessState]:
    robot = view.robots.get(name)
    return [] if robot is None else robot.entries(listener.now_us())


def _stands(view: LabView, name: str, listener: Listener) -> bool:
    """Return whether nothing makes the robot move, as far as is known."""
    robot = view.robots.get(name)
    status = None if robot is None else robot.status(listener.now_us())
    return status is None or status.v_setpoint_m_per_s == status.omega_setpoint_rad_per_s == 0.0


def _started_here(entry: ProcessState) -> bool:
    """Return whether a command of this machine, and still there, started a process."""
    from offboard.lab.process_notes import is_klab

    report = entry.report
    return (
        report is not None
        and report.host == socket.gethostname()
        and is_klab(report.supervisor_pid)
    )


def _others_text(entries: list[ProcessState], supervisors: set[int]) -> str:
    """Return in words who goes on without the commands ``here``, and who may stop it."""
    texts = []
    for e in entries:
        if e.state != "alive":
            continue
        if e.report is None:
            texts.append(f"{e.name} (process {e.pid}: started by hand, end it there by Ctrl-C)")
        elif e.report.host != socket.gethostname():
            texts.append(f"{e.name} (on {e.report.host}: `klab down` there)")
        elif e.report.supervisor_pid not in supervisors:
            texts.append(f"{e.name} (process {e.pid}, of process {e.report.supervisor_pid})")
    return ", ".join(texts)


def _listen(lab: LabConfig) -> tuple[Listener, LabView]:
    """Listen for as long as it takes to hear everybody."""
    from offboard.lab.present_nodes import LISTEN_S
    from offboard.monitor.lab_view import LabView

    listener, view = options.listen(lab), LabView(lab)
    listener.overhear(view.take)
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
            table.add_row(robot, e.name, e.state + ended, str(e.pid), heard, needs, e.stopped_by)
    out.print(table)
    for robot, entries in sorted(processes.items()):
        for e in entries:
            if e.report is not None and e.state == DIED:
                out.print(f"{robot} {e.name}: {e.report.log_file} ends with:", markup=False)
                out.print(e.report.last_lines or "(it said nothing)", markup=False)

"""`klab down`: how to end the processes of a robot, or of all that this machine runs."""

from __future__ import annotations

import contextlib
import os
import signal
import socket
from typing import TYPE_CHECKING

import typer

from offboard.commands.status import listen_to_all
from offboard.commands.topics import spin_for
from offboard.terminal import options
from offboard.terminal.exit_codes import ExitCode
from offboard.terminal.output import err
from offboard.terminal.visible_text import one_line

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from koopman_lab.config.schema import LabConfig
    from offboard.monitor.lab_view import LabView
    from offboard.monitor.process_states import ProcessState

END_LIMIT_S = 60.0
"""Seven processes that all ignore SIGINT and SIGTERM take 42 s."""


def down(
    all_robots: options.AllRobots = False,
    config: options.ConfigFile = None,
    overrides: options.Overrides = None,
    robot_name: options.RobotsName = None,
    url: options.Url = None,
) -> None:
    """End the commands of this machine that run processes of a robot, as Ctrl-C in each would.

    Who commands the robot is ended first, and the others when it stands. What goes on, because
    another machine or a person started it, is named; the exit code is then 1. With --all every
    robot on the bus is brought down, all at the same time, and each is named.

    Example: klab down --robot-name R2
    """
    from koopman_lab.errors import LabStateError
    from offboard.lab.child_process import PATIENCE_S
    from offboard.lab.own_processes import alive
    from offboard.lab.process_notes import running_commands
    from offboard.monitor.process_states import SILENT_S

    options.refuse_one_and_all(robot_name, all_robots=all_robots)
    lab = options.resolve(config, overrides, None, url=url, robot_name=robot_name)
    noted, interrupts = running_commands(lab.bus.url), _Interrupts()
    names = list(noted) if all_robots else [lab.robot.name]
    by_name = {name: _RobotsCommands(name, noted.get(name, {})) for name in names}
    # Before anything is heard, which takes a second: meanwhile the robot would drive on.
    for robot in by_name.values():
        interrupts.send(robot.commanding)
    listener, view = listen_to_all(lab)
    if all_robots:
        for name, seen in view.robots.items():
            if seen.alive(listener.now_us()) and name not in by_name:
                by_name[name] = _RobotsCommands(name, {})
    robots = [by_name[name] for name in sorted(by_name)]
    for robot in robots:
        robot.look(view, listener.now_us(), lab.bus.url)
    everybody = {pid for robot in robots for pid in robot.supervisors}
    if not everybody:
        raise LabStateError(_nobody_text(lab, robots, all_robots=all_robots))
    commanding = {pid for robot in robots for pid in robot.commanding}
    interrupts.send(commanding)
    if commanding:
        spin_for(
            listener,
            PATIENCE_S,
            lambda: all(robot.stands(view, listener.now_us()) for robot in robots),
        )
    interrupts.send(everybody)
    spin_for(listener, END_LIMIT_S, lambda: not any(map(alive, everybody)))
    if any(robot.others for robot in robots):
        spin_for(listener, SILENT_S)
    _report(robots, view, listener.now_us())


class _Interrupts:
    """Sends each command one Ctrl-C: a second one would be more than a person asked for."""

    def __init__(self) -> None:
        self._sent: set[int] = set()

    def send(self, pids: Iterable[int]) -> None:
        for pid in set(pids) - self._sent:
            self._sent.add(pid)
            with contextlib.suppress(ProcessLookupError):
                os.kill(pid, signal.SIGINT)


class _RobotsCommands:
    """The commands of this machine that run processes of one robot, by process number.

    Parameters
    ----------
    name
        Of the robot.
    noted
        Those that have noted so, with the processes that they started.
    """

    def __init__(self, name: str, noted: Mapping[int, set[str]]) -> None:
        from koopman_lab.bus.processes import commanders

        self.name = name
        self.supervisors = set(noted)
        self.commanding = {pid for pid, names in noted.items() if names & commanders()}
        """Those that run a node that commands the robot."""
        self.others = ""
        """Who goes on without them, in words, and who may stop it."""

    def look(self, view: LabView, now_us: int, url: str) -> None:
        """Learn from what is heard on the bus who else runs processes of the robot."""
        from koopman_lab.bus.processes import process

        entries = _entries(view, self.name, now_us)
        for entry in entries:
            if entry.state not in ("finished", "died") and _started_here(entry, url, self.name):
                assert entry.report is not None
                self.supervisors.add(entry.report.supervisor_pid)
                if process(entry.name).commands:
                    self.commanding.add(entry.report.supervisor_pid)
        self.others = _others_text(entries, self.supervisors)

    def stands(self, view: LabView, now_us: int) -> bool:
        """Return whether nothing makes the robot move, as far as is known, or nobody drove it."""
        robot = view.robots.get(self.name)
        status = None if robot is None else robot.status(now_us)
        if status is None or not self.commanding:
            return True
        return status.v_setpoint_m_per_s == status.omega_setpoint_rad_per_s == 0.0


def _entries(view: LabView, name: str, now_us: int) -> list[ProcessState]:
    robot = view.robots.get(name)
    return [] if robot is None else robot.entries(now_us)


def _started_here(entry: ProcessState, url: str, robot_name: str) -> bool:
    """Return whether a command of this machine, and still there, started a process.

    What is said on the bus anybody may have said: process numbers count only where the machine
    itself says the same of them.
    """
    from offboard.lab.own_processes import is_started_by
    from offboard.lab.process_notes import may_run

    report = entry.report
    return (
        report is not None
        and report.host == socket.gethostname()
        and is_started_by(entry.pid, entry.name, report.supervisor_pid)
        and may_run(report.supervisor_pid, url, robot_name)
    )


def _others_text(entries: Sequence[ProcessState], supervisors: set[int]) -> str:
    """Return in words who goes on without these commands, and who may stop it."""
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


def _nobody_text(lab: LabConfig, robots: Sequence[_RobotsCommands], *, all_robots: bool) -> str:
    """Return in words that there is nothing to bring down, and what is there all the same."""
    nobody = f"no `klab up`, `calibrate` or `park` of this machine runs on {lab.bus.url}"
    if not all_robots:
        nobody = f"{lab.robot.name}: {nobody}"
    present = [robot for robot in robots if robot.others]
    others = "; ".join(
        f"{robot.name}: {robot.others}" if all_robots else robot.others for robot in present
    )
    return f"{nobody}; still there: {others}" if others else nobody


def _report(robots: Sequence[_RobotsCommands], view: LabView, now_us: int) -> None:
    """Say of each robot whether it is down.

    Raises
    ------
    LabStateError
        If a command goes on.
    """
    from koopman_lab.errors import LabStateError
    from offboard.lab.child_process import KILLED
    from offboard.lab.own_processes import alive

    still_running, goes_on = [], False
    for robot in robots:
        left = sorted(filter(alive, robot.supervisors))
        if left:
            pids = ", ".join(map(str, left))
            still_running.append(f"{robot.name}: still running: process {pids}")
            continue
        entries = _entries(view, robot.name, now_us)
        for e in entries:
            if e.report is not None and e.report.ended == KILLED:
                err.print(f"{e.name} (process {e.pid}) did not end by itself: {KILLED}")
        others = robot.others and _others_text(entries, robot.supervisors)
        goes_on = goes_on or bool(others)
        if others:
            err.print(one_line(f"{robot.name} is not down; still there: {others}"))
        elif robot.supervisors:
            err.print(one_line(f"{robot.name} is down"))
    if still_running:
        raise LabStateError("; ".join(still_running))
    if goes_on:
        raise typer.Exit(ExitCode.NO)

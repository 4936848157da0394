"""Runs a session of any kind, on virtual time or in real time, and what is the same for all kinds.

On virtual time the whole lab is in this process. In real time each node has one of its own, and
this one starts what is missing, watches, and reads what the commanding node has brought.
"""

from __future__ import annotations

import contextlib
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Generic

import typer
from pydantic import ValidationError

from koopman_lab.bus.channels import INTERLOCK, ONBOARD_STATUS, PLANT_RESET
from koopman_lab.bus.commanders import commander_number
from koopman_lab.bus.realtime import Listener, run_node
from koopman_lab.config.schema import LabConfig
from koopman_lab.errors import LabError, LabStateError
from koopman_lab.files import write_json
from koopman_lab.units import US_PER_S
from offboard.desk.placing import reset_message
from offboard.lab.lab_lock import lab_lock
from offboard.lab.nodes import lockstep_lab
from offboard.lab.place_robot import place
from offboard.lab.present_nodes import present_nodes
from offboard.lab.run_folder import RunFolder
from offboard.lab.session_kind import N, Outcome, SessionKind
from offboard.lab.session_watch import RobotWatch, StartWatch
from offboard.lab.supervisor import Supervisor, start_missing, supervised
from offboard.terminal.exit_codes import ExitCode
from offboard.terminal.output import Report, err, progress

INTERRUPTED = ExitCode.INTERRUPTED
WAIT_S = 0.2
"""Between two looks at the processes."""


@dataclass(frozen=True)
class Run(Generic[Outcome]):
    """What a session has brought, and how many times faster than real time it ran."""

    outcome: Outcome
    times_real_time: float


@contextlib.contextmanager
def keeping_the_log(folder: RunFolder, next_step: str = "") -> Iterator[None]:
    """End the command after Ctrl-C inside the block; what was recorded stays, and is named.

    ``next_step`` is what a person can do next, after that and after an expected mistake.
    """
    try:
        yield
    except KeyboardInterrupt:
        if folder.log.exists():
            err.print(f"interrupted; what was recorded is in {folder.log}")
            err.print(next_step, end="\n" if next_step else "")
        else:
            err.print(f"interrupted; nothing was recorded in {folder.path}")
        raise typer.Exit(INTERRUPTED) from None
    except LabError as error:
        if next_step and folder.log.exists():
            raise type(error)(f"{error}\n{next_step}") from None
        raise


def run_session(
    kind: SessionKind[N, Outcome], config: LabConfig, folder: RunFolder, listener: Listener | None
) -> Run[Outcome]:
    """Run a session to its end; one that is interrupted keeps its log.

    Parameters
    ----------
    kind
        What the session does.
    config
        The lab.
    folder
        Takes the files.
    listener
        Of this process; None for lockstep.

    Raises
    ------
    LabError
        If the session cannot be run: the node cannot do its work as configured, the robot is held
        still, silent or another's, or a process dies or does not start.
    """
    lockstep = listener is None
    with (
        keeping_the_log(folder, kind.after_interruption(folder, lockstep=lockstep)),
        progress(kind.doing, kind.unit) as report,
    ):
        if listener is None:
            return _in_lockstep(kind, config, folder, report)
        return Run(_in_real_time(kind, config, folder, listener, report), 1.0)


def run_process(
    kind: SessionKind[N, Outcome], config: LabConfig, result: Path | None, lifeline_fd: int | None
) -> None:
    """Run the node of a session in this process, in real time, and write down what it has brought.

    Parameters
    ----------
    kind, config
        As of the session.
    result
        Takes the outcome as JSON; None to leave it.
    lifeline_fd
        As for :func:`~koopman_lab.bus.realtime.run_node`.

    Raises
    ------
    LabError
        If the node cannot do its work as configured, or the bus cannot be opened.
    """
    node = kind.make_node(config)
    statistics = run_node(node, config, lifeline_fd=lifeline_fd)
    if result is not None:
        write_json(result, kind.outcome(node, statistics.missed_ticks).model_dump())


def read_outcome(file: Path, outcome_type: type[Outcome]) -> Outcome:
    """Return what the node of a session has written down.

    Raises
    ------
    LabStateError
        If the file is not there, or holds something else.
    """
    try:
        return outcome_type.model_validate_json(file.read_bytes())
    except (OSError, ValidationError) as error:
        reason = error.strerror if isinstance(error, OSError) else "it holds something else"
        raise LabStateError(
            f"{file}: the outcome of the session cannot be read ({reason}); is another version of "
            "this software installed meanwhile? What was recorded is whole"
        ) from None


def _in_lockstep(
    kind: SessionKind[N, Outcome], config: LabConfig, folder: RunFolder, report: Report
) -> Run[Outcome]:
    node = kind.make_node(config)
    lab = lockstep_lab(config, folder, node, kind.resume_us)
    try:
        began_s, began_us = time.perf_counter(), lab.now_us
        if kind.start is not None:
            lab.publish(PLANT_RESET, reset_message(kind.start, lab.now_us))

        def show(now_s: float) -> None:
            report(*kind.progress(node, now_s, config))

        lab.run(kind.limit_s(config), on_progress=show)
        show(lab.now_us / US_PER_S)
        passed_s = (lab.now_us - began_us) / US_PER_S
        speed = passed_s / (time.perf_counter() - began_s)
    finally:
        lab.close()
    return Run(kind.outcome(node, 0), speed)


def _in_real_time(
    kind: SessionKind[N, Outcome],
    config: LabConfig,
    folder: RunFolder,
    listener: Listener,
    report: Report,
) -> Outcome:
    result = folder.path / "processes" / f"{kind.node_name}.json"
    present = present_nodes(listener)
    robot = RobotWatch(config)
    listener.subscribe(ONBOARD_STATUS, lambda status: robot.see(status, listener.now_us()))
    with contextlib.ExitStack() as stack:
        if "onboard" not in present:
            stack.enter_context(lab_lock(config))
        lab = stack.enter_context(supervised(config, folder, listener))
        report(0, 0, "waits for the processes of the lab to start")
        start_missing(lab, present, folder, resume=kind.resume_us is not None)
        if kind.start is not None:
            by_hand = "onboard" in present and "plant" not in present
            report(0, 0, "waits for the cameras to see the robot at its start")
            place(listener, config, kind.start, by_hand=by_hand)
        lab.start(kind.node_name, *kind.arguments(), "--result", result)
        robot.commander = commander_number(kind.node_name, lab.process(kind.node_name))
        _show_progress(kind, config, listener, lab, robot, report)
    outcome = read_outcome(result, kind.outcome_type)
    result.unlink()
    return outcome


def _show_progress(
    kind: SessionKind[N, Outcome],
    config: LabConfig,
    listener: Listener,
    lab: Supervisor,
    robot: RobotWatch,
    report: Report,
) -> None:
    """Show how far the node is until it ends; refuse to wait for what will not come."""
    start = StartWatch(kind.node_name, kind.waits_for(config), kind.start_limit_s(config))
    first_us: int | None = None
    obstacle = ""
    needs = f"waits for {kind.waits_for(config)}"
    report(0, 0, needs)

    def hear(interlock: Any) -> None:
        nonlocal obstacle
        obstacle = interlock.reason
        start.hear(obstacle, listener.now_us())

    def show(state: Any) -> None:
        nonlocal first_us
        start.begun = start.begun or kind.has_begun(state)
        now_us = listener.now_us()
        first_us = now_us if first_us is None else first_us
        done, total, note = kind.progress_reported(state, (now_us - first_us) / US_PER_S, config)
        waits_for = f"waits: {obstacle}" if obstacle else "" if start.begun else needs
        notes = note, waits_for
        report(done, total, "; ".join(filter(None, notes)))

    listener.subscribe(INTERLOCK, hear)
    listener.subscribe(kind.state_channel, show)
    while not lab.ended(kind.node_name):
        listener.spin(WAIT_S)
        lab.check()
        now_us = listener.now_us()
        robot.check(now_us)
        start.check(now_us)
    lab.check()

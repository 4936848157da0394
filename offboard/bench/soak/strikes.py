"""What breaks in a soak: rows of the table of faults, and processes that die or hang."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

from koopman_lab.bus.channels import ESTOP
from koopman_lab.config.schema import LabConfig
from koopman_lab.config.simulation import Fault
from koopman_lab.errors import LabStateError
from koopman_lab.robots.robot_type import RobotType
from offboard.bench.faults.bounds import (
    Bound,
    by_controller,
    by_driver,
    by_estop,
    by_watchdog,
)
from offboard.bench.faults.scenarios import SCENARIOS
from offboard.bench.faults.stage import Activity
from offboard.bench.faults.strikes import Inject
from offboard.bench.soak.standing_lab import StandingLab
from offboard.desk.drive_inputs import LOGGER_TIMEOUT_S
from offboard.desk.orders import stop_order

HANGS_S = 3.0
WATCHED_S = 8.0
"""After a strike; what is not over by then ends with it."""
COMMANDERS: dict[Activity, str] = {"park": "controller", "calibrate": "sampler"}


@dataclass(frozen=True)
class Strike:
    """Something that goes wrong while the robot of a real lab drives.

    Attributes
    ----------
    name
        What.
    activity
        What the robot is doing.
    act
        Makes it go wrong, in the lab whose log is in the folder.
    bound
        Largest time (s) until the robot stands and goes on standing; None if it may drive on.
    wrong
        What is wrong from before the session. When that shows depends on where the robot happens to
        stand and drive, so it is judged by the floor alone.
    faults
        What the plant is told to end afterwards.
    """

    name: str
    activity: Activity
    act: Callable[[StandingLab, Path], None]
    bound: Bound | None = None
    wrong: tuple[Fault, ...] = ()
    faults: tuple[Fault, ...] = ()


def strikes_for(robot: RobotType) -> list[Strike]:
    """Return all that can go wrong with a kind of robot."""
    return [*_of_table(robot), *_of_processes()]


def _of_table(robot: RobotType) -> Iterator[Strike]:
    """Give the rows of the table of faults that one message to the plant brings about."""
    for row in SCENARIOS:
        if not row.is_for(robot):
            continue
        if row.wrong:
            yield Strike(row.name, row.activity, _nothing, None, row.wrong, row.wrong)
        elif isinstance(row.strike, Inject):
            fault = row.strike.fault
            lasts_s = WATCHED_S if fault.duration_s is None else fault.duration_s
            yield Strike(
                row.name, row.activity, _inject(fault, lasts_s), row.bound, faults=(fault,)
            )


def _of_processes() -> Iterator[Strike]:
    """Give what can happen to processes, and what a person does."""
    for activity, commander in COMMANDERS.items():
        yield Strike(f"{commander} killed", activity, _signal(commander, "SIGKILL"), by_watchdog)
        yield Strike(f"{commander} hangs for 3 s", activity, _hang(commander), by_watchdog)
        yield Strike("session killed", activity, _kill_session, by_watchdog)
        yield Strike("onboard loop killed", activity, _signal("onboard", "SIGKILL"), by_driver)
        yield Strike("onboard loop hangs for 3 s", activity, _hang("onboard"), by_driver)
        yield Strike("logger killed", activity, _signal("logger", "SIGKILL"), _by_logger)
        yield Strike("page killed", activity, _signal("view", "SIGKILL"))
        yield Strike("emergency stop", activity, _estop, by_estop)
        yield Strike("second session", activity, _second_session)


def _by_logger(config: LabConfig) -> float:
    """Return the time to rest after the logger is gone (s)."""
    return by_controller(config, LOGGER_TIMEOUT_S)


def _nothing(lab: StandingLab, folder: Path) -> None:
    del lab, folder


def _inject(fault: Fault, lasts_s: float) -> Callable[[StandingLab, Path], None]:
    return lambda lab, _: lab.inject(fault, lasts_s)


def _signal(name: str, number: str) -> Callable[[StandingLab, Path], None]:
    return lambda lab, _: os.kill(lab.pids[name], signal.Signals[number])


def _hang(name: str) -> Callable[[StandingLab, Path], None]:
    def act(lab: StandingLab, folder: Path) -> None:
        del folder
        pid = lab.pids[name]
        os.kill(pid, signal.SIGSTOP)
        lab.spin(HANGS_S)
        os.kill(pid, signal.SIGCONT)

    return act


def _kill_session(lab: StandingLab, folder: Path) -> None:
    del folder
    assert lab.session is not None  # by the order of a cycle
    lab.session.kill()


def _estop(lab: StandingLab, folder: Path) -> None:
    del folder
    order = stop_order(lambda: lab.status, release=False)
    while (obeyed := order.step(lab.listener)) is None:
        lab.listener.spin(0.01)
    if not obeyed:
        raise LabStateError(f"{ESTOP.suffix}: the motor loop does not confirm the stop")


def _second_session(lab: StandingLab, folder: Path) -> None:
    """Start a calibration beside what drives the robot; it is refused."""
    second = lab.also("calibrate", "--segments", "1", "--out", folder.with_name("second"))
    lab.wait(lambda: second.poll() is not None, "second session: goes on")

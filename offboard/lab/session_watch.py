"""Watches whether a session can begin and go on: a robot that is held, stopped or silent."""

from __future__ import annotations

from typing import TYPE_CHECKING

import lcmtypes
from koopman_lab.bus.channels import ONBOARD_STATUS
from koopman_lab.bus.commanders import NOBODY, commander_name
from koopman_lab.bus.motor_loop_faults import why_stopped
from koopman_lab.bus.node import Port
from koopman_lab.config.schema import LabConfig
from koopman_lab.errors import LabStateError
from koopman_lab.robots.table import robot_type
from koopman_lab.units import US_PER_S
from offboard.desk.commander import ONBOARD_TIMEOUT_S

if TYPE_CHECKING:
    from koopman_lab.bus.realtime import Listener

LISTEN_S = 0.5
"""Five status messages."""
PATIENCE_S = 3.0
"""For a person who has just stopped the robot, and releases it again."""
START_LIMIT_S = 30.0
"""In which a node finds everything that it needs, and begins."""
REPORT_S = 2.0
"""In which a controller that gives a silent robot up says so itself."""


class RobotWatch:
    """Refuses to wait for a person who does not know of it: the robot is held still, or silent.

    Parameters
    ----------
    config
        Names the robot.
    commander
        Number of who commands in this session; None while nobody does.
    """

    def __init__(self, config: LabConfig, commander: int | None = None) -> None:
        self.commander = commander
        self._channel = ONBOARD_STATUS.name(config.robot.name)
        # Longer than any radio hole that a session bridges.
        self._silence_s = ONBOARD_TIMEOUT_S + config.controller.pause_limit_s + REPORT_S
        self._heard_us: int | None = None
        self._stopped_us: int | None = None
        self._reason: str | None = None

    def see(self, status: lcmtypes.onboard_status_t, now_us: int) -> None:
        """Take a status that arrived at ``now_us``."""
        self._heard_us = now_us
        self._reason = self._interlock(status)
        if self._reason is None:
            self._stopped_us = None
        elif self._stopped_us is None:
            self._stopped_us = now_us

    def check(self, now_us: int) -> None:
        """Look whether there is still something to wait for.

        Raises
        ------
        LabStateError
            If the robot has been held still, or silent, for a while.
        """
        if self._heard_us is None:
            self._heard_us = now_us
        if now_us - self._heard_us > self._silence_s * US_PER_S:
            raise LabStateError(
                f"{self._channel}: silent for {self._silence_s:g} s; is the onboard loop running, "
                "and does the radio reach it? A robot without commands stops by itself"
            )
        if self._stopped_us is not None and now_us - self._stopped_us > PATIENCE_S * US_PER_S:
            raise LabStateError(f"{self._channel}: {self._reason}")

    def _interlock(self, status: lcmtypes.onboard_status_t) -> str | None:
        why = why_stopped(status)
        if why is not None:
            return (
                f"the robot is stopped ({why}); mend the cause, then `klab estop --release` while "
                "its onboard program runs (`klab up`), and start again"
            )
        if self.commander is None or status.commander in (NOBODY, self.commander):
            return None
        return held_text(status.commander)


class StartWatch:
    """Refuses to wait for a node that does not begin.

    Parameters
    ----------
    node
        Its name.
    waits_for
        What it needs, and what a person can do about it.
    limit_s
        In which it must have begun.
    """

    def __init__(self, node: str, waits_for: str, limit_s: float = START_LIMIT_S) -> None:
        self.begun = False
        """To be set when it has begun."""
        self._obstacle = ""
        self._obstacle_us: int | None = None
        self._message = f"{node}: has not begun within {limit_s:g} s; it waits for {waits_for}"
        self._limit_us = round(limit_s * US_PER_S)
        self._begun_us: int | None = None

    def hear(self, obstacle: str, now_us: int) -> None:
        """Take what the node says that forbids driving; whoever says so is ready for all else."""
        self._obstacle = obstacle
        if self._obstacle_us is None:
            self._obstacle_us = now_us

    def check(self, now_us: int) -> None:
        """Look whether there is still something to wait for; the first look begins the wait.

        Raises
        ------
        LabStateError
            If it has not begun within the limit, or for so long after it was ready.
        """
        if self._begun_us is None:
            self._begun_us = now_us
        since_ready_us = 0 if self._obstacle_us is None else now_us - self._obstacle_us
        late = now_us - self._begun_us > self._limit_us or since_ready_us > START_LIMIT_S * US_PER_S
        if late and not self.begun:
            sees = f"; it sees: {self._obstacle}" if self._obstacle else ""
            raise LabStateError(f"{self._message}{sees}")


def held_text(commander: int) -> str:
    """Return what to say of a robot that another commander holds."""
    return (
        f"the robot is held by {commander_name(commander)}; let that session end, or name another "
        "robot with --robot-name"
    )


def session_listener(config: LabConfig, *, lockstep: bool) -> Listener | None:
    """Open the bus for a session, before it leaves any trace on the disk; None in lockstep.

    Raises
    ------
    BusError
        If the bus cannot be opened.
    ConfigError
        If all is to be simulated, and nothing is.
    LabStateError
        If somebody drives the robot already, or our motor loop would have to and cannot.
    """
    from koopman_lab.bus.realtime import Listener

    robot = robot_type(config.robot.kind)
    if lockstep:
        robot.on_two_wheels()
        config.require_simulation()
        return None
    listener = Listener(config)
    statuses: list[lcmtypes.onboard_status_t] = []
    listener.subscribe(ONBOARD_STATUS, statuses.append)
    end_us = listener.now_us() + round(LISTEN_S * US_PER_S)
    while not statuses and (left_us := end_us - listener.now_us()) > 0:
        listener.spin(left_us / US_PER_S)
    if not statuses:
        robot.on_two_wheels()
    elif statuses[-1].commander != NOBODY:
        channel = ONBOARD_STATUS.name(config.robot.name)
        raise LabStateError(f"{channel}: {held_text(statuses[-1].commander)}")
    return listener


class RobotWatchNode:
    """The watch as a node, for lockstep, where the session has no listener of its own."""

    name = "onlooker"

    def __init__(self, config: LabConfig) -> None:
        self._watch = RobotWatch(config)

    def attach(self, port: Port) -> None:
        """Listen to ONBOARD_STATUS."""
        port.subscribe(ONBOARD_STATUS, lambda status: self._watch.see(status, port.now_us()))
        port.every(1.0, self._watch.check)

    def close(self) -> None:
        """Nothing is held."""

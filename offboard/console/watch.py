"""Notices a robot with which a session cannot go on."""

from __future__ import annotations

import lcmtypes
from koopman_lab.bus.channels import ONBOARD_STATUS
from koopman_lab.bus.node import Port
from koopman_lab.config.schema import LabConfig
from koopman_lab.errors import LabStateError
from koopman_lab.units import US_PER_S
from offboard.commander import why_stopped

PATIENCE_S = 3.0
"""Longer than any radio hole that a session bridges."""


class RobotWatch:
    """Refuses to wait for a person who does not know of it: the robot is held still, or silent.

    Parameters
    ----------
    config
        Names the robot.
    """

    def __init__(self, config: LabConfig) -> None:
        self._channel = ONBOARD_STATUS.name(config.robot.name)
        self._heard_us: int | None = None
        self._stopped_us: int | None = None
        self._why: str | None = None

    def see(self, status: lcmtypes.onboard_status_t, now_us: int) -> None:
        """Take a status that arrived at ``now_us``."""
        self._heard_us = now_us
        self._why = why_stopped(status)
        if self._why is None:
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
        patience_us = PATIENCE_S * US_PER_S
        if now_us - self._heard_us > patience_us:
            raise LabStateError(
                f"{self._channel}: silent for {PATIENCE_S:g} s; is the onboard loop running, and "
                "does the radio reach it? A robot without commands stops by itself"
            )
        if self._stopped_us is not None and now_us - self._stopped_us > patience_us:
            raise LabStateError(
                f"{self._channel}: the robot is stopped ({self._why}); mend the cause, then "
                "`klab estop --release`, and start again"
            )


class Onlooker:
    """The watch as a node, for lockstep, where the session has no ear of its own on the bus."""

    name = "onlooker"

    def __init__(self, config: LabConfig) -> None:
        self._watch = RobotWatch(config)

    def attach(self, port: Port) -> None:
        """Listen to ONBOARD_STATUS."""
        port.subscribe(ONBOARD_STATUS, lambda status: self._watch.see(status, port.now_us()))
        port.every(1.0, self._watch.check)

    def close(self) -> None:
        """Nothing is held."""

"""Hears a second onboard program of the same robot on the bus."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable

import lcmtypes
from koopman_lab.bus import channels
from koopman_lab.bus.age import is_current
from koopman_lab.bus.node import Port
from koopman_lab.bus.replay_guard import from_log
from koopman_lab.units import US_PER_S
from onboard.desk_time import DeskTime

MESSAGES = 3
"""So many in :data:`WITHIN_US` are no remainder of a program that ended before this one began."""
WITHIN_US = US_PER_S
REMEMBERED = 128
"""Own messages, which come back from the bus: those of some ten seconds."""


class SecondLoop:
    """Listens to ONBOARD_STATUS for what this program has not said.

    A log that is sent again is no second program: its times are not of now.

    Parameters
    ----------
    port, time
        Of the node.
    found
        Is called with the present time (us) as long as a second program speaks.
    """

    def __init__(self, port: Port, time: DeskTime, found: Callable[[int], None]) -> None:
        self._port, self._time, self._found = port, time, found
        self._said: deque[tuple[int, int]] = deque(maxlen=REMEMBERED)
        self._heard_us: deque[int] = deque(maxlen=MESSAGES)
        port.subscribe(channels.ONBOARD_STATUS, self._on_status)

    def remember(self, status: lcmtypes.onboard_status_t) -> None:
        """Take a status that this program has just sent."""
        self._said.append((status.sequence, status.utime))

    def _on_status(self, status: lcmtypes.onboard_status_t) -> None:
        now_us = self._port.now_us()
        if (status.sequence, status.utime) in self._said:
            return
        if from_log(status.utime, self._time.to_desk(now_us)):
            return
        self._heard_us.append(now_us)
        if len(self._heard_us) == MESSAGES and is_current(self._heard_us[0], now_us, WITHIN_US):
            self._found(now_us)

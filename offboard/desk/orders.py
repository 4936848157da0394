"""Orders of a person, sent until the robot obeys, as UDP loses messages; the order to stop it.

It imports little: whoever stops a robot has no time to load what only others need.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Generic, Protocol

import lcmtypes
from koopman_lab.bus.channel import Channel, M
from koopman_lab.bus.channels import ESTOP

TRIES = 100
"""After so many in vain a person is told, and all but an endless order are given up."""
WAIT_S = 0.02
"""Between tries; two seconds until then."""


class Sender(Protocol):
    """What an order needs of the bus: to publish, and the time."""

    def publish(self, channel: Channel[M], message: M) -> None:
        """Send a message."""

    def now_us(self) -> int:
        """Return the present time (us)."""


class Order(Generic[M]):
    """One order, which is sent again until it is obeyed.

    Parameters
    ----------
    channel
        On which it is sent.
    message
        Returns the message, stamped with a time (us).
    obeyed
        Returns whether the robot says that it obeys.
    tries
        After how many it is given up; None for never.
    """

    def __init__(
        self,
        channel: Channel[M],
        message: Callable[[int], M],
        obeyed: Callable[[], bool],
        tries: int | None = TRIES,
    ) -> None:
        self._channel = channel
        self._message = message
        self._obeyed = obeyed
        self._tries = tries
        self.sent_times = 0

    def step(self, sender: Sender) -> bool | None:
        """Send it once more; return whether it was obeyed, None as long as that is open."""
        if self.sent_times and self._obeyed():
            return True
        if self.sent_times == self._tries:
            return False
        self.sent_times += 1
        sender.publish(self._channel, self._message(sender.now_us()))
        return None


def stop_order(
    status: Callable[[], lcmtypes.onboard_status_t | None],
    *,
    release: bool,
    tries: int | None = TRIES,
) -> Order[lcmtypes.estop_t]:
    """Return the order to stop the motors, or to release them and acknowledge a fault.

    A release names the stop that the robot said last, so that it counts whatever the clock here
    says; see ``estop_t``.

    Parameters
    ----------
    status
        Returns the newest status of the motor loop, None if it is silent.
    release
        Release instead of stopping.
    tries
        As of :class:`Order`.
    """

    def message(utime: int) -> lcmtypes.estop_t:
        stop = lcmtypes.estop_t()
        stop.utime, stop.engaged = utime, not release
        newest = status()
        if release and newest is not None:
            stop.stop_number = newest.stop_number
        return stop

    def obeyed() -> bool:
        newest = status()
        if newest is None:
            return False
        # A commander that waits for it may take a released robot at once.
        stopped = newest.state == newest.ESTOP
        return newest.state not in (newest.ESTOP, newest.FAULT) if release else stopped

    return Order(ESTOP, message, obeyed, tries)

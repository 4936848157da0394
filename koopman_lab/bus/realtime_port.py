"""A node's side of the LCM bus in real time: signs what it sends, lets in what it may hear."""

from __future__ import annotations

import heapq
import os
import time
from collections.abc import Callable
from itertools import count
from typing import TYPE_CHECKING

from koopman_lab.bus.channel import Channel, M
from koopman_lab.bus.filtered_bus import FilteredBus
from koopman_lab.bus.multicast import drain
from koopman_lab.bus.port import BasePort, Publication
from koopman_lab.bus.subscription import Deliver, Subscription

if TYPE_CHECKING:
    from koopman_lab.bus.authentication import Signer
    from koopman_lab.config.schema import LabConfig


def boot_ns() -> int:
    """Return the time since the computer was started (ns), also that in which it slept.

    CLOCK_MONOTONIC leaves sleep out on Linux: a program would go on after a night as if nothing had
    been, and its stamps would be those of the evening.
    """
    return time.clock_gettime_ns(_BOOT_CLOCK)


_BOOT_CLOCK = getattr(time, "CLOCK_BOOTTIME", time.CLOCK_MONOTONIC)
"""Of Linux; other systems count sleep in the monotonic clock."""


class Clock:
    """Microseconds since the Unix epoch that never step: a clock since boot, offset once.

    Parameters
    ----------
    since_boot_ns
        Returns the time since some moment (ns); never steps.
    """

    def __init__(self, since_boot_ns: Callable[[], int] = boot_ns) -> None:
        self._since_boot_ns = since_boot_ns
        self._offset_us = (time.time_ns() - since_boot_ns()) // 1000

    def now_us(self) -> int:
        """Return the present time in us."""
        return self._since_boot_ns() // 1000 + self._offset_us


class RealtimePort(BasePort):
    """A node's side of the LCM bus.

    Parameters
    ----------
    node_name, config
        Whose it is.
    bus
        Opened.
    key
        Of the lab: what is sent on protected channels carries its tag, what is heard there must.
        None where there is no key.
    """

    virtual = False

    def __init__(
        self, node_name: str, config: LabConfig, bus: FilteredBus, key: bytes | None
    ) -> None:
        super().__init__(node_name, config, os.getpid())
        self._key = key
        self._signer = None if key is None else _signer(key)
        self._signed: set[str] = set()
        """The channels on the bus whose messages are signed."""
        self._bus_clock = Clock()
        self._pending: list[tuple[int, int, Deliver, bytes]] = []
        self._sequence = count()
        self.bus = bus

    def bus_us(self) -> int:
        """Return the present time in us since the Unix epoch."""
        return self._bus_clock.now_us()

    def send(self, name: str, data: bytes) -> None:
        """Publish the bytes on LCM, signed where the channel is protected."""
        if name in self._signed:
            assert self._signer is not None
            data = self._signer.sign(name, data)
        self.bus.publish(name, data)

    def _open(self, channel: Channel[M]) -> Publication:
        publication = super()._open(channel)
        if self._signer is not None and channel.protection != "never":
            self._signed.add(publication[0])
        return publication

    def subscription(self, channel: Channel[M]) -> Subscription:
        """Return what messages of a channel go through; a protected one lets in who has the key."""
        subscription = super().subscription(channel)
        is_protected = self._key is not None and channel.protection != "never"
        if is_protected and subscription.admission is None:
            from koopman_lab.bus.admission import admission_of

            assert self._key is not None
            name = channel.name(self.robot_name)
            subscription.admission = admission_of(self._key, channel, name)
        return subscription

    def deliver_at(self, at_us: int, deliver: Deliver, data: bytes) -> None:
        """Hand over a message when the loop next finds it due."""
        heapq.heappush(self._pending, (at_us, next(self._sequence), deliver, data))

    def next_us(self) -> int | None:
        """Return when something is next due; None if nothing ever is."""
        due = [timer.deadline_us for timer in self.timers]
        if self._pending:
            due.append(self._pending[0][0])
        return min(due, default=None)

    def run_pending(self) -> None:
        """Hand over the messages that are due, oldest first."""
        while self._pending and self._pending[0][0] <= (now_us := self.bus_us()):
            _, _, deliver, data = heapq.heappop(self._pending)
            deliver(data, now_us)

    def listen(self) -> None:
        """Subscribe at LCM to every channel that has a handler; call once, after attaching."""
        self.listen_to(*self.subscriptions)

    def listen_to(self, *names: str) -> None:
        """Subscribe at LCM to channels that have a handler."""
        self.bus.subscribe_exactly({name: self._arrival(name) for name in names})

    def _arrival(self, name: str) -> Callable[[str, bytes], None]:
        subscription = self.subscriptions[name]
        deliver, admission = subscription.arrive, subscription.admission

        def take(_: str, data: bytes) -> None:
            now_us = self.bus_us()
            if admission is None or admission.admits_at(data, now_us):
                deliver(data, now_us)

        return take

    def drain(self) -> None:
        """Handle what has arrived; of very much, a part."""
        drain(self.bus)


def _signer(key: bytes) -> Signer:
    # Here, as most labs have no key, and who stops a robot is not to wait for it.
    from koopman_lab.bus.authentication import Signer

    return Signer(key)

"""A node's side of the bus, as far as both runners share it: handlers, timers, heartbeats."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Container
from functools import partial
from itertools import count
from typing import TYPE_CHECKING

import lcmtypes
from koopman_lab.bus.channel import Channel, M
from koopman_lab.bus.channels import HEARTBEATS
from koopman_lab.bus.node import Node, Port, RawHandler, Tick
from koopman_lab.bus.publishers import StreamIdentity
from koopman_lab.bus.replay_guard import guard_of
from koopman_lab.bus.subscription import Deliver, Subscription
from koopman_lab.units import US_PER_S

if TYPE_CHECKING:
    from koopman_lab.config.schema import LabConfig


class Timer:
    """Absolute deadlines at ``start_us + k / rate_hz``; keeps count of ticks run and skipped."""

    def __init__(self, rate_hz: float, tick: Tick) -> None:
        self.rate_hz = rate_hz
        self.tick = tick
        self.deadline_us = 0
        """Nominal time of the next tick."""
        # Of fractions, so that deadlines are exact however long it runs.
        ticks, seconds = rate_hz.as_integer_ratio()
        self._seconds_us, self._ticks, self._two_ticks = 2 * seconds * US_PER_S, ticks, 2 * ticks
        self.start(0)

    def start(self, at_us: int) -> None:
        """Start again, and count again, with a first tick at ``at_us``."""
        self._start_us = self.deadline_us = at_us
        self._index = 0
        self.missed = 0

    @property
    def ticks_run(self) -> int:
        """Return how many ticks have been run."""
        return self._index - self.missed

    def fire(self, now_us: int) -> int:
        """Run the newest tick that is due and return how late it was (us).

        Older ticks that are due as well are skipped and counted: a burst to catch up would run
        the component at times that have passed.
        """
        late_us = now_us - self.deadline_us
        skipped = late_us * self._two_ticks // self._seconds_us
        if skipped > 0:
            self.missed += skipped
            self._index += skipped - 1
            late_us = now_us - self.go_on()
        self.tick(self.deadline_us)
        self.go_on()
        return late_us

    def go_on(self) -> int:
        """Count a tick that has been run; return the nominal time of the next one (us)."""
        self._index = index = self._index + 1
        self.deadline_us = deadline_us = (
            self._start_us + (index * self._seconds_us + self._ticks) // self._two_ticks
        )
        return deadline_us


Publication = tuple[str, Callable[[], int]]
"""The name of a channel that a node speaks on, and what returns the number of its next message."""


class AnyName:
    """Contains every channel name."""

    def __contains__(self, _: object) -> bool:
        """Return True."""
        return True


class BasePort(ABC):
    """The part of :class:`koopman_lab.bus.node.Port` that does not depend on the runner.

    What is simulated between a node and the bus is a port wrapped around this one
    (:mod:`koopman_lab.emulation`). Besides a node's methods it uses :meth:`bus_us`,
    :meth:`deliver_at`, :meth:`number` and :meth:`send` to publish in its own way, and
    :meth:`subscription` to put something between the bus and a handler.
    """

    virtual: bool
    audience: Container[str] = AnyName()
    """The channels on the bus that somebody may listen to."""

    def __init__(self, node_name: str, config: LabConfig, process: int) -> None:
        self.robot_name = config.robot.name
        self.subscriptions: dict[str, Subscription] = {}
        """What the node listens to, by channel name."""
        self.timers: list[Timer] = []
        self.finished = False
        self.worst_lateness_us = 0
        self._node_name = node_name
        self.process = process
        self._publications: dict[str, Publication] = {}
        """By the suffix of the channel."""
        self._heartbeat_rate_hz = config.bus.heartbeat_rate_hz

    @abstractmethod
    def bus_us(self) -> int:
        """Return the present time of the bus, in which the runner plans (us)."""

    def now_us(self) -> int:
        """Return the present time by the node's own clock (us)."""
        return self.bus_us()

    @abstractmethod
    def send(self, name: str, data: bytes) -> None:
        """Put an encoded message on the bus."""

    @abstractmethod
    def deliver_at(self, at_us: int, deliver: Deliver, data: bytes) -> None:
        """Hand over a message at ``at_us`` or, in real time, as soon after as it can."""

    def attach(self, node: Node, wrap: Wrap | None = None) -> None:
        """Let the node register itself, then add its heartbeat.

        What ``wrap`` returns, if there is one, stands between this port and the node.
        """
        port: Port = self if wrap is None else wrap(self)
        node.attach(port)
        port.every(self._heartbeat_rate_hz, partial(self._heartbeat, port))

    def publish(self, channel: Channel[M], message: M) -> None:
        """Send a message with the next sequence number of its channel."""
        # As number() does, without a call more on the way of every message.
        try:
            name, next_number = self._publications[channel.suffix]
        except KeyError:
            name, next_number = self._open(channel)
        message.sequence = next_number()
        if name in self.audience:
            self.send(name, message.encode())

    def number(self, channel: Channel[M], message: M) -> str:
        """Give a message the next number of its channel; return the channel's name on the bus."""
        name, next_number = self._publications.get(channel.suffix) or self._open(channel)
        message.sequence = next_number()
        return name

    def _open(self, channel: Channel[M]) -> Publication:
        publication = channel.name(self.robot_name), count().__next__
        self._publications[channel.suffix] = publication
        return publication

    def subscribe(self, channel: Channel[M], handler: Callable[[M], None]) -> None:
        """Call ``handler`` with every message of a channel that can be decoded.

        A message is decoded once, however many handlers a node has for its channel. Who has it
        decoded acts on it: what is a log's is kept off, where the channel says so.
        """
        subscription = self.subscription(channel)
        if not subscription.handlers:
            subscription.guard = guard_of(channel.replayed)
        subscription.handlers.append(handler)

    def subscribe_raw(self, channel: Channel[M], handler: RawHandler) -> None:
        """Call ``handler`` with every message of a channel as bytes."""
        self.subscription(channel).raw_handlers.append(handler)

    def subscription(self, channel: Channel[M]) -> Subscription:
        """Return what messages of a channel go through; the first call begins to listen."""
        name = channel.name(self.robot_name)
        subscription = self.subscriptions.get(name)
        if subscription is None:
            subscription = self.subscriptions[name] = Subscription(name, channel.type)
        return subscription

    def every(self, rate_hz: float, tick: Tick) -> None:
        """Call ``tick`` at absolute deadlines."""
        self.timers.append(Timer(rate_hz, tick))

    def finish(self) -> None:
        """Tell the runner that this node's work is done."""
        self.finished = True

    @property
    def undecodable(self) -> int:
        """Return how many messages could not be decoded, or lack the lab's key."""
        subscriptions = self.subscriptions.values()
        admissions = [s.admission for s in subscriptions if s.admission is not None]
        strange = sum(subscription.undecodable for subscription in subscriptions)
        return strange + sum(admission.without_key for admission in admissions)

    def lost_messages(self) -> dict[str, int]:
        """Return, by channel name, how many messages the sequence numbers show missing."""
        return {
            name: subscription.counter.lost for name, subscription in self.subscriptions.items()
        }

    def publishers(self, channel: Channel[M]) -> StreamIdentity:
        """Return who speaks now on a channel, by its numbers; nobody where it is not listened to.

        One publisher, as it should be, stands for nobody, too.
        """
        subscription = self.subscriptions.get(channel.name(self.robot_name))
        if subscription is None:
            return StreamIdentity()
        return subscription.publishers.identity(self.bus_us())

    def without_key(self, channel: Channel[M]) -> int:
        """Return how many messages of a channel were dropped because they lack the lab's key."""
        subscription = self.subscriptions.get(channel.name(self.robot_name))
        admission = None if subscription is None else subscription.admission
        return 0 if admission is None else admission.without_key

    def ticks(self) -> tuple[int, int]:
        """Return ``(run, missed)`` over all timers."""
        return sum(t.ticks_run for t in self.timers), sum(t.missed for t in self.timers)

    def _heartbeat(self, port: Port, now_us: int) -> None:
        channel = HEARTBEATS.get(self._node_name)
        if channel is None:
            return
        status = lcmtypes.node_status_t()
        status.utime = now_us
        status.pid = self.process
        status.ticks, status.missed_ticks = self.ticks()
        status.worst_lateness_us = self.worst_lateness_us
        status.lost_messages = sum(self.lost_messages().values())
        status.undecodable_messages = self.undecodable
        self.worst_lateness_us = 0
        port.publish(channel, status)


Wrap = Callable[[BasePort], Port]
"""Returns a port for the node, which stands around that of the runner."""

"""What both runners share: handlers, timers, sequence numbers, loss counts, heartbeats."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Container
from functools import partial

import lcmtypes
from koopman_lab.bus.channels import ABOARD, FAULT, HEARTBEATS, PLANT_RESET, Channel, M, Message
from koopman_lab.bus.node import Node, RawHandler, Tick
from koopman_lab.bus.subscription import Subscription
from koopman_lab.config.schema import LabConfig
from koopman_lab.emulation.drifting_clock import DriftingClock
from koopman_lab.emulation.faults import Faults, fault_of
from koopman_lab.emulation.radio import RadioPair, radio_pair
from koopman_lab.emulation.wire import Wire
from koopman_lab.units import US_PER_S

Deliver = Callable[[bytes, int], None]
"""Called with the bytes of a message and the time in us."""


class Timer:
    """Absolute deadlines at ``start_us + k / rate_hz``; keeps count of ticks run and skipped."""

    def __init__(self, rate_hz: float, tick: Tick) -> None:
        self.rate_hz = rate_hz
        self.tick = tick
        self.deadline_us = 0
        """Nominal time of the next tick."""
        self._period_us = US_PER_S / rate_hz
        self.start(0)

    def start(self, at_us: int) -> None:
        """Start again, and count again, with a first tick at ``at_us``."""
        self._start_us = self.deadline_us = at_us
        self._index = 0
        self.missed = 0

    @property
    def run(self) -> int:
        """Return how many ticks have been run."""
        return self._index - self.missed

    def fire(self, now_us: int) -> int:
        """Run the newest tick that is due and return how late it was (us).

        Older ticks that are due as well are skipped and counted: a burst to catch up would run
        the component at times that have passed.
        """
        late_us = now_us - self.deadline_us
        if late_us >= self._period_us:
            behind = int(late_us / self._period_us)
            self.missed += behind
            self._index += behind
            self.deadline_us = self._start_us + round(self._index * self._period_us)
            late_us = now_us - self.deadline_us
        self.fire_in_time()
        return late_us

    def fire_in_time(self) -> None:
        """Run the next tick, where none can be late."""
        self.tick(self.deadline_us)
        self._index = index = self._index + 1
        self.deadline_us = self._start_us + round(index * self._period_us)


class Publication:
    """One channel that a node speaks on."""

    def __init__(self, name: str, by_radio: bool) -> None:
        self.name = name
        self.by_radio = by_radio
        self.next_sequence = 0


class Anything:
    """Contains whatever is asked for."""

    def __contains__(self, _: object) -> bool:
        """Return True."""
        return True


class BasePort(ABC):
    """The part of :class:`koopman_lab.bus.node.Port` that does not depend on the runner."""

    virtual: bool
    audience: Container[str] = Anything()
    """The channels on the bus that somebody may listen to."""

    def __init__(self, node_name: str, config: LabConfig, process: int, start_us: int) -> None:
        self.robot_name = config.robot.name
        self.subscriptions: dict[str, Subscription] = {}
        """By channel name."""
        self.timers: list[Timer] = []
        self.finished = False
        self.worst_lateness_us = 0
        self._node_name = node_name
        self.process = process
        self._publications: dict[str, Publication] = {}
        self._heartbeat_rate_hz = config.bus.heartbeat_rate_hz
        self._radio: RadioPair | None = None
        self._clock: DriftingClock | None = None
        if node_name == ABOARD:
            self._faults = Faults(config.faults, start_us)
            self._radio = radio_pair(config)
            self._clock = DriftingClock(config.clock, start_us, self._faults)
            self.subscribe(FAULT, self._on_fault)

    @abstractmethod
    def bus_us(self) -> int:
        """Return the present time of the bus, in which the runner plans (us)."""

    def now_us(self) -> int:
        """Return the present time by the node's own clock (us)."""
        bus_us = self.bus_us()
        return bus_us if self._clock is None else self._clock.read(bus_us)

    @abstractmethod
    def send(self, name: str, data: bytes) -> None:
        """Put an encoded message on the bus."""

    @abstractmethod
    def later(self, at_us: int, take: Deliver, data: bytes) -> None:
        """Hand over a message at ``at_us`` or, in real time, as soon after as it can."""

    def attach(self, node: Node) -> None:
        """Let the node register itself, then add its heartbeat."""
        node.attach(self)
        self.every(self._heartbeat_rate_hz, self._heartbeat)

    def publish(self, channel: Channel[M], message: M) -> None:
        """Send a message with the next sequence number of its channel."""
        publication = self._publications.get(channel.suffix) or self._open(channel)
        message.sequence = publication.next_sequence
        publication.next_sequence += 1
        if publication.by_radio:
            self._transmit(publication.name, message)
        elif publication.name in self.audience:
            self.send(publication.name, message.encode())

    def _open(self, channel: Channel[M]) -> Publication:
        by_radio = self._radio is not None and not channel.wired
        publication = Publication(channel.name(self.robot_name), by_radio)
        self._publications[channel.suffix] = publication
        return publication

    def _transmit(self, name: str, message: Message) -> None:
        assert self._radio is not None
        now_us = self.bus_us()
        # Numbered before the radio, so that the others see what it loses; its luck hangs on every
        # message, also on those that nobody hears.
        arrivals_us = self._radio.from_robot.arrivals(now_us, self._faults.at(now_us).loss)
        if name not in self.audience:
            return
        data = message.encode()
        for at_us in arrivals_us:
            if at_us <= now_us:
                self.send(name, data)
            else:
                self.later(at_us, lambda data, _: self.send(name, data), data)

    def subscribe(self, channel: Channel[M], handler: Callable[[M], None]) -> None:
        """Call ``handler`` with every message of a channel that can be decoded.

        A message is decoded once, however many handlers a node has for its channel.
        """
        self._subscription(channel).handlers.append(handler)

    def subscribe_raw(self, channel: Channel[M], handler: RawHandler) -> None:
        """Call ``handler`` with every message of a channel as bytes."""
        self._subscription(channel).raw_handlers.append(handler)

    def _subscription(self, channel: Channel[M]) -> Subscription:
        name = channel.name(self.robot_name)
        subscription = self.subscriptions.get(name)
        if subscription is None:
            wired_end = channel.wired and self._node_name in (ABOARD, "plant")
            subscription = self.subscriptions[name] = Subscription(
                name,
                channel.type,
                self._clock,
                by_radio=self._radio is not None and not channel.wired,
                wire=Wire() if wired_end and channel.rate != "event" else None,
                by_hand=channel in (FAULT, PLANT_RESET),
                restamped=channel.wired,
            )
        return subscription

    def every(self, rate_hz: float, tick: Tick) -> None:
        """Call ``tick`` at absolute deadlines.

        They keep the pace of the bus, also aboard: on a real board motor ticks and encoder
        readings hang on one crystal, and the plant's encoders could not slide along with another.
        """
        clock = self._clock
        own_tick = tick if clock is None else lambda bus_us: tick(clock.read(bus_us))
        self.timers.append(Timer(rate_hz, own_tick))

    def finish(self) -> None:
        """Tell the runner that this node's work is done."""
        self.finished = True

    @property
    def undecodable(self) -> int:
        """Return how many messages could not be decoded."""
        return sum(subscription.undecodable for subscription in self.subscriptions.values())

    def lost_messages(self) -> dict[str, int]:
        """Return, by channel name, how many messages the sequence numbers show missing."""
        return {
            name: subscription.counter.lost for name, subscription in self.subscriptions.items()
        }

    def receiver(self, name: str) -> Deliver:
        """Return what takes a channel's messages off the bus.

        The radio may bring one to the node later, twice, or never.
        """
        subscription = self.subscriptions[name]
        return (
            partial(self._receive_by_radio, subscription)
            if subscription.by_radio
            else subscription.receive
        )

    def _receive_by_radio(self, subscription: Subscription, data: bytes, sent_us: int) -> None:
        assert self._radio is not None
        for at_us in self._radio.to_robot.arrivals(sent_us, self._faults.at(sent_us).loss):
            if at_us <= sent_us:
                subscription.receive(data, at_us)
            else:
                self.later(at_us, subscription.receive, data)

    def _on_fault(self, message: lcmtypes.fault_t) -> None:
        fault = fault_of(message)
        if fault is not None:
            self._faults.inject(fault, self.bus_us())

    def ticks(self) -> tuple[int, int]:
        """Return ``(run, missed)`` over all timers."""
        return sum(t.run for t in self.timers), sum(t.missed for t in self.timers)

    def _heartbeat(self, now_us: int) -> None:
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
        self.publish(channel, status)

"""What a node is, and what a runner gives it.

A node ties one pure component to channels and timers. It never asks for a clock, a socket or a
sleep: it is handed a :class:`Port` once, registers what it listens to and how often it ticks, and
from then on is only called back. The same node therefore runs in real time and in lockstep.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from koopman_lab.bus.channel import Channel, M
from koopman_lab.bus.publishers import StreamIdentity

RawHandler = Callable[[str, bytes, int], None]
"""Called with the channel's full name, the bytes, and the time of arrival in us."""

Tick = Callable[[int], None]
"""Called with the tick's nominal time in us (the deadline, not the moment it was run)."""


class Port(Protocol):
    """A node's side of the bus; times are int64 microseconds of a clock that does not step.

    That clock is the node's own, which can differ from that of other nodes.
    """

    robot_name: str
    process: int
    """Number of the process that the node runs in; 0 in lockstep, where there is only one."""
    virtual: bool
    """True in lockstep: durations measured on the wall mean nothing and must not be published."""

    def now_us(self) -> int:
        """Return the present time: of the Unix epoch in real time, from 0 in lockstep."""

    def publish(self, channel: Channel[M], message: M) -> None:
        """Encode and send a message; the runner fills in ``sequence``."""

    def subscribe(self, channel: Channel[M], handler: Callable[[M], None]) -> None:
        """Call ``handler`` with every decoded message of a channel, in order of arrival."""

    def subscribe_raw(self, channel: Channel[M], handler: RawHandler) -> None:
        """Call ``handler`` with every message of a channel as bytes."""

    def every(self, rate_hz: float, tick: Tick) -> None:
        """Call ``tick`` at absolute deadlines; ticks that come too late are skipped and counted."""

    def lost_messages(self) -> dict[str, int]:
        """Return, by channel name, how many messages the sequence numbers show missing."""

    def publishers(self, channel: Channel[M]) -> StreamIdentity:
        """Return whether one publisher speaks now on a channel that the node listens to.

        :func:`koopman_lab.bus.publishers.identity_faults` says in words what is wrong. A few
        microseconds: for a tick, not for every message.
        """

    def without_key(self, channel: Channel[M]) -> int:
        """Return how many messages of a channel were dropped because they lack the lab's key."""

    def finish(self) -> None:
        """Tell the runner that this node's work is done."""


class Node(Protocol):
    """A thin tie between one component and the bus."""

    name: str
    """Also names the heartbeat channel the runner publishes for it."""

    def attach(self, port: Port) -> None:
        """Subscribe and set timers."""

    def close(self) -> None:
        """Leave everything in order: flush files, send a last stop. Called once, at the end."""

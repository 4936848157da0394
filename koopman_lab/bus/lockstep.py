"""All nodes in one process on virtual time: the same config and seed give the same bytes.

One event queue, ordered by (time, node order, messages before timers, sequence). Messages go
before timers because the real-time runner, too, drains its socket before it runs what is due.
Every message that a node listens to is encoded and decoded as on the wire; one that nobody hears
is only numbered.
"""

from __future__ import annotations

from collections.abc import Callable
from heapq import heappop, heappush, heapreplace
from itertools import count
from typing import Any

from koopman_lab.bus.channel import Channel, M
from koopman_lab.bus.node import Node
from koopman_lab.bus.port import BasePort, Wrap
from koopman_lab.bus.subscription import Deliver
from koopman_lab.config.schema import LabConfig
from koopman_lab.units import US_PER_S

MESSAGE, TIMER = 0, 1
NEVER_US = 2**63
"""Of a message that no timer waits for, so that there is always one to compare with."""


Delivery = tuple[int, int, int, Any, bytes]
"""When a message is due (us), the rank of its listener, its number, and who gets which bytes."""


def message_rank(order: int) -> int:
    """Return the place of a node's messages among all that happens at one time.

    Parameters
    ----------
    order
        Of the node, from 0.
    """
    return 2 * order + MESSAGE


class LockstepPort(BasePort):
    """A node's side of the virtual bus."""

    virtual = True

    def __init__(self, node_name: str, config: LabConfig, runner: Lockstep, order: int) -> None:
        super().__init__(node_name, config, runner.process)
        self._runner = runner
        self._rank = message_rank(order)
        self.audience = runner.routes

    def bus_us(self) -> int:
        """Return the virtual time in us, from 0 unless a record is run again."""
        return self._runner.now_us

    def finish(self) -> None:
        """Tell the runner that this node's work is done."""
        super().finish()
        self._runner.finished = True

    def send(self, name: str, data: bytes) -> None:
        """Queue the message for every node that listens."""
        runner = self._runner
        listeners = runner.routes.get(name)
        if listeners is not None:
            for rank, receive in listeners:
                # As push() does, without a call more for each.
                item = (runner.now_us, rank, runner.number(), receive, data)
                heappush(runner.messages, item)

    def deliver_at(self, at_us: int, deliver: Deliver, data: bytes) -> None:
        """Hand over a message at ``at_us`` among this node's others."""
        self._runner.push(at_us, self._rank, deliver, data)


class Lockstep:
    """Runs nodes in lockstep.

    Nodes are added in the order in which they act at equal times: plant, onboard, logger, then
    who commands.

    Parameters
    ----------
    config
        The lab.
    start_us
        Virtual time at which it begins.
    process
        Number of the nodes' process, where a record of another one is run again.
    """

    def __init__(self, config: LabConfig, start_us: int = 0, process: int = 0) -> None:
        self.now_us = start_us
        self.process = process
        self.finished = False
        """Whether a node's work is done."""
        self._config = config
        self._nodes: list[Node] = []
        self._ports: list[LockstepPort] = []
        self.routes: dict[str, list[tuple[int, Deliver]]] = {}
        """Maps a channel's name to its listeners: a node's rank, and what hands it messages."""
        # Apart, because most messages come at once, past all the timers that wait.
        self.messages: list[Delivery] = [(NEVER_US, 0, 0, None, b"")]
        """A heap of those that are under way."""
        self._timers: list[tuple[int, int, int, Any]] = []
        self.number = count().__next__
        """Returns a number that orders what is due at one time for one node."""
        self._injector: LockstepPort | None = None

    def add(self, node: Node, wrap: Wrap | None = None) -> None:
        """Attach a node, to what ``wrap`` makes of its port; its order is the order of adding."""
        order = len(self._ports)
        port = LockstepPort(node.name, self._config, self, order)
        port.attach(node, wrap)
        self._nodes.append(node)
        self._ports.append(port)
        for name, subscription in port.subscriptions.items():
            listener = message_rank(order), subscription.arrive
            self.routes.setdefault(name, []).append(listener)
        for timer in port.timers:
            timer.start(self.now_us)
            item = (timer.deadline_us, 2 * order + TIMER, self.number(), timer)
            heappush(self._timers, item)

    def publish(self, channel: Channel[M], message: M) -> None:
        """Send a message as if somebody outside the nodes had sent it now."""
        self._injection_port().publish(channel, message)

    def send(self, name: str, data: bytes) -> None:
        """Send bytes as if somebody outside the nodes had sent them now."""
        self._injection_port().send(name, data)

    def push(self, at_us: int, rank: int, deliver: Deliver, data: bytes) -> None:
        """Hand a message over at ``at_us``, among the others of the node of this rank."""
        heappush(self.messages, (at_us, rank, self.number(), deliver, data))

    def run(
        self,
        limit_s: float,
        until: Callable[[], bool] | None = None,
        on_progress: Callable[[float], None] | None = None,
    ) -> bool:
        """Run until a node finishes, ``until`` is true, or ``limit_s`` more seconds have passed.

        Parameters
        ----------
        limit_s
            Virtual seconds from now.
        until
            Asked once every virtual second.
        on_progress
            Told the virtual time in s once every virtual second.

        Returns
        -------
        Whether a node finished or ``until`` became true.
        """
        end_us = self.now_us + round(limit_s * US_PER_S)
        next_report_us = self.now_us
        messages, timers, number = self.messages, self._timers, self.number
        pop, replace = heappop, heapreplace
        now_us = self.now_us
        # Every node has a timer, its heartbeat; so there is one as soon as there is a node.
        while timers:
            next_timer = timers[0]
            time_us, rank, _, timer = next_timer
            is_message = messages[0] < next_timer
            if is_message:
                time_us = messages[0][0]
            if time_us > now_us:
                if time_us > end_us:
                    break
                if self.finished:
                    return True
                self.now_us = now_us = time_us
            if is_message:
                _, _, _, deliver, data = pop(messages)
                deliver(data, time_us)
            else:
                timer.tick(time_us)
                replace(timers, (timer.go_on(), rank, number(), timer))
            if time_us >= next_report_us:
                next_report_us += US_PER_S
                if on_progress is not None:
                    on_progress(time_us / US_PER_S)
                if until is not None and until():
                    return True
        self.now_us = end_us
        return False

    def close(self) -> None:
        """Close the nodes, last added first."""
        for node in reversed(self._nodes):
            node.close()

    def _injection_port(self) -> LockstepPort:
        if self._injector is None:
            self._injector = LockstepPort("", self._config, self, order=0)
        return self._injector

"""All nodes in one process on virtual time: the same config and seed give the same bytes.

One event queue, ordered by (time, node order, messages before timers, sequence). Messages go
before timers because the real-time runner, too, drains its socket before it runs what is due.
Every message is encoded and decoded as on the wire.
"""

from __future__ import annotations

import heapq
import zlib
from collections.abc import Callable
from itertools import count
from typing import Any

import numpy as np

from koopman_lab.bus.channels import Channel, M, split_name
from koopman_lab.bus.node import Node
from koopman_lab.bus.port import BasePort, Timer
from koopman_lab.config.schema import LabConfig, Link
from koopman_lab.units import US_PER_S

MESSAGE, TIMER = 0, 1


class LockstepPort(BasePort):
    """A node's side of the virtual bus."""

    virtual = True

    def __init__(self, node_name: str, config: LabConfig, runner: Lockstep) -> None:
        super().__init__(node_name, config, pid=0)
        self._runner = runner

    def now_us(self) -> int:
        """Return the virtual time in us, from 0."""
        return self._runner.now_us

    def finish(self) -> None:
        """Tell the runner that this node's work is done."""
        super().finish()
        self._runner.finished = True

    def send(self, name: str, data: bytes) -> None:
        """Queue the message for every node that listens."""
        self._runner.send(name, data)


class Lockstep:
    """Runs nodes in lockstep.

    Nodes are added in the order in which they act at equal times: plant, onboard, logger, then
    who commands. ``config.bus.links`` may delay or drop the messages of a channel, for each
    receiver on its own.
    """

    def __init__(self, config: LabConfig) -> None:
        self.now_us = 0
        self.finished = False
        """Whether a node's work is done."""
        self._config = config
        self._nodes: list[Node] = []
        self._ports: list[LockstepPort] = []
        self._routes: dict[str, list[tuple[int, LockstepPort]]] = {}
        self._queue: list[tuple[int, int, int, int, Any]] = []
        self._sequence = count()
        self._links: dict[str, tuple[Link, np.random.Generator]] = {}
        self._injector: LockstepPort | None = None
        for suffix, link in config.bus.links.items():
            seed = np.random.SeedSequence([config.seed, zlib.crc32(suffix.encode())])
            self._links[suffix] = (link, np.random.default_rng(seed))

    def add(self, node: Node) -> None:
        """Attach a node; its order is the order of adding."""
        port = LockstepPort(node.name, self._config, self)
        port.attach(node)
        order = len(self._ports)
        self._nodes.append(node)
        self._ports.append(port)
        for name in port.handlers:
            self._routes.setdefault(name, []).append((order, port))
        for timer in port.timers:
            timer.start_us = self.now_us
            self._push_timer(order, timer)

    def publish(self, channel: Channel[M], message: M) -> None:
        """Send a message as if somebody outside the nodes had sent it now."""
        if self._injector is None:
            self._injector = LockstepPort("", self._config, self)
        self._injector.publish(channel, message)

    def send(self, name: str, data: bytes) -> None:
        """Queue encoded bytes for every node that listens to a channel."""
        routes = self._routes.get(name)
        if not routes:
            return
        link = self._links.get(split_name(name)[1].suffix) if self._links else None
        for order, port in routes:
            arrival_us = self.now_us
            if link is not None:
                settings, rng = link
                if rng.random() < settings.loss:
                    continue
                arrival_us += round(settings.delay_s * US_PER_S)
            item = (arrival_us, order, MESSAGE, next(self._sequence), (port, name, data))
            heapq.heappush(self._queue, item)

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
        while self._queue and self._queue[0][0] <= end_us:
            time_us, order, kind, _, what = self._queue[0]
            if time_us > self.now_us and self.finished:
                return True
            heapq.heappop(self._queue)
            self.now_us = time_us
            if kind == MESSAGE:
                port, name, data = what
                port.deliver(name, data, time_us)
            else:
                what.fire(time_us)
                self._push_timer(order, what)
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

    def _push_timer(self, order: int, timer: Timer) -> None:
        item = (timer.deadline_us, order, TIMER, next(self._sequence), timer)
        heapq.heappush(self._queue, item)

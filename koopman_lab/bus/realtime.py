"""The runner in real time: one node in this process, over LCM; and a listener for commands."""

from __future__ import annotations

import contextlib
import gc
import os
import select
import signal
from collections.abc import Callable, Iterator
from types import FrameType
from typing import TYPE_CHECKING, Any, NamedTuple

from koopman_lab.bus.channel import Channel, M
from koopman_lab.bus.lab_key import configured_key
from koopman_lab.bus.multicast import drain, open_lcm
from koopman_lab.bus.node import Node, RawHandler
from koopman_lab.bus.port import Wrap
from koopman_lab.bus.priority import ask_for_priority
from koopman_lab.bus.processes import priority_of
from koopman_lab.bus.realtime_port import RealtimePort
from koopman_lab.errors import ConfigError
from koopman_lab.units import US_PER_S

if TYPE_CHECKING:
    from koopman_lab.bus.pacing import TickTimes
    from koopman_lab.config.schema import LabConfig

LONGEST_WAIT_S = 0.5
"""A node without timers still looks up this often."""


class StopSignals:
    """Turns SIGINT and SIGTERM into a flag and a readable file descriptor."""

    def __init__(self) -> None:
        self.received = False
        self._read, self._write = os.pipe()
        os.set_blocking(self._write, False)

    def fileno(self) -> int:
        """Return the descriptor that becomes readable on a signal."""
        return self._read

    @contextlib.contextmanager
    def installed(self) -> Iterator[None]:
        """Catch the signals inside the block."""
        stop_signals = (signal.SIGINT, signal.SIGTERM)
        previous_handlers = {
            number: signal.signal(number, self._on_signal) for number in stop_signals
        }
        try:
            yield
        finally:
            for number, handler in previous_handlers.items():
                signal.signal(number, handler)
            os.close(self._read)
            os.close(self._write)

    def _on_signal(self, number: int, frame: FrameType | None) -> None:
        del number, frame
        self.received = True
        with contextlib.suppress(BlockingIOError):
            os.write(self._write, b"\0")


class RunStatistics(NamedTuple):
    """How a node's run in real time went."""

    ticks: int
    missed_ticks: int
    lost_messages: int


def run_node(
    node: Node,
    config: LabConfig,
    *,
    wrap: Wrap | None = None,
    lifeline_fd: int | None = None,
    tick_times: TickTimes | None = None,
) -> RunStatistics:
    """Run one node until SIGINT, SIGTERM, its own finish, or the end of the lifeline.

    Parameters
    ----------
    node
        What to run; its ``close`` is called in every case.
    wrap
        Returns the port that the node has, around that of the bus.
    lifeline_fd
        Read end of a pipe whose write end the supervisor holds and never writes to. When the
        supervisor dies, even by SIGKILL, the pipe ends and so does this node.
    tick_times
        Told when each tick of the node's fastest timer begins.

    Returns
    -------
    What the heartbeats said at the end.

    Raises
    ------
    BusError
        If the bus cannot be opened.
    ConfigError
        If the key that the configuration names cannot be used.
    """
    # First of all: the thread in which LCM receives inherits it, and would be starved without.
    ask_for_priority(priority_of(node.name))
    key = configured_key(config)
    port = RealtimePort(node.name, config, open_lcm(config), key)
    stop = StopSignals()
    with stop.installed():
        try:
            port.attach(node, wrap)
            port.listen()
            _loop(port, stop, lifeline_fd, tick_times)
        finally:
            node.close()
    return RunStatistics(*port.ticks(), sum(port.lost_messages().values()))


def _loop(
    port: RealtimePort,
    stop: StopSignals,
    lifeline_fd: int | None,
    tick_times: TickTimes | None,
) -> None:
    # A collection over start-up's objects would cost milliseconds in the middle of a tick.
    gc.collect()
    gc.freeze()
    bus_fd = port.bus.fileno()
    wait_for: list[Any] = [bus_fd, stop]
    if lifeline_fd is not None:
        wait_for.append(lifeline_fd)
    fastest = max(port.timers, key=lambda timer: timer.rate_hz)
    start_us = port.bus_us()
    for timer in port.timers:
        timer.start(start_us)
    while not (stop.received or port.finished):
        next_us = port.next_us()
        wait_s = LONGEST_WAIT_S
        if next_us is not None:
            wait_s = min(wait_s, max(0.0, (next_us - port.bus_us()) / US_PER_S))
        readable, _, _ = select.select(wait_for, (), (), wait_s)
        if lifeline_fd is not None and lifeline_fd in readable:
            return
        try:
            if bus_fd in readable:
                port.drain()
        except OSError:
            # LCM's wait ends this way when a signal handler ran in it.
            if not stop.received:
                raise
            return
        port.run_pending()
        for timer in sorted(port.timers, key=lambda t: t.deadline_us):
            now_us = port.bus_us()
            if timer.deadline_us <= now_us:
                if tick_times is not None and timer is fastest:
                    tick_times.note(now_us)
                lateness = timer.fire(now_us)
                port.worst_lateness_us = max(port.worst_lateness_us, lateness)


class Listener:
    """A person's process on the bus: listens and now and then speaks, but keeps no rate.

    Parameters
    ----------
    config
        Names bus, robot and key.
    on_bad_key
        Told what is wrong with a key that cannot be used, which is then left out, as who stops a
        robot needs none.

    Raises
    ------
    BusError
        If the bus cannot be opened.
    ConfigError
        If the key that the configuration names cannot be used, and nobody is told.
    """

    def __init__(self, config: LabConfig, on_bad_key: Callable[[str], None] | None = None) -> None:
        self._config, self._key = config, None
        try:
            self._key = configured_key(config)
        except ConfigError as error:
            if on_bad_key is None:
                raise
            on_bad_key(f"{error}; what is said without it may be anybody's")
        self._bus = open_lcm(config)
        self._port = RealtimePort("", config, self._bus, self._key)

    def subscribe(self, channel: Channel[M], handler: Callable[[M], None]) -> None:
        """Call ``handler`` with every message of a channel."""
        name = channel.name(self._port.robot_name)
        known = name in self._port.subscriptions
        self._port.subscribe(channel, handler)
        if not known:
            self._port.listen_to(name)

    def overhear(self, handler: RawHandler, refused: RawHandler | None = None) -> None:
        """Call ``handler`` with every message on the bus, of all robots and other programs.

        Where the lab has a key, ``refused`` is called instead with those on protected channels that
        lack its tag, or were sent before.
        """
        port, admissions = self._port, None
        if self._key is not None:
            from koopman_lab.bus.admission import Admissions

            admissions = Admissions(self._key)

        def take(name: str, data: bytes) -> None:
            if admissions is None or admissions.admits(name, data):
                handler(name, data, port.bus_us())
            elif refused is not None:
                refused(name, data, port.bus_us())

        self._bus.subscribe_to_all(take)

    def without_key(self, channel: Channel[M]) -> int:
        """Return how many messages of a channel were dropped because they lack the lab's key."""
        return self._port.without_key(channel)

    def filter_fault(self) -> str:
        """Begin to listen; return why no filter keeps hostile datagrams off, empty if one does."""
        self._bus.fileno()
        return self._bus.filter_fault

    def publish(self, channel: Channel[M], message: M) -> None:
        """Send a message; its ``utime`` is the caller's to set (see :meth:`now_us`)."""
        self._port.publish(channel, message)

    def speaking_to(self, robot_name: str) -> RealtimePort:
        """Return what publishes on the channels of another robot, on the same bus."""
        port = RealtimePort("", self._config, self._bus, self._key)
        port.robot_name = robot_name
        return port

    def now_us(self) -> int:
        """Return the present time in us since the Unix epoch."""
        return self._port.now_us()

    def spin(self, timeout_s: float) -> bool:
        """Wait for messages, handle what has arrived; return whether there were any."""
        readable, _, _ = select.select([self._bus.fileno()], (), (), timeout_s)
        if readable:
            drain(self._bus)
        return bool(readable)

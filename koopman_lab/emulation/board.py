"""The board of a simulated robot: a port behind a radio, with a clock of its own, and faults."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import lcmtypes
from koopman_lab.bus.channel import Channel, M
from koopman_lab.bus.channels import FAULT
from koopman_lab.bus.header import restamp
from koopman_lab.bus.node import RawHandler, Tick
from koopman_lab.bus.port import BasePort, Wrap
from koopman_lab.bus.subscription import Deliver
from koopman_lab.config.schema import LabConfig
from koopman_lab.config.simulation import Simulation
from koopman_lab.emulation.drifting_clock import DriftingClock
from koopman_lab.emulation.faults import Faults
from koopman_lab.emulation.radio import radio_pair


class EmulatedBoard:
    """A :class:`koopman_lab.bus.node.Port` around that of the bus, for the program of the board.

    Whatever is not wired crosses the radio, each way. The board's clock stamps what it reads from
    its own hardware, and is the only one that the program sees.

    Parameters
    ----------
    port
        The port of the bus.
    simulation
        How good radio and clock are, and what goes wrong by itself, counted from now.
    seed
        Decides, with the robot's name, the radio's luck.
    """

    def __init__(self, port: BasePort, simulation: Simulation, seed: int) -> None:
        self.robot_name, self.process, self.virtual = port.robot_name, port.process, port.virtual
        self.lost_messages, self.finish = port.lost_messages, port.finish
        self.publishers, self.without_key = port.publishers, port.without_key
        self._port = port
        self._faults = Faults(simulation.faults, port.bus_us())
        self._radio = radio_pair(simulation.radio, seed, port.robot_name)
        self._clock = DriftingClock(simulation.clock, port.bus_us(), self._faults)
        port.subscribe(FAULT, self._on_fault)

    def now_us(self) -> int:
        """Return the present time by the board's clock (us)."""
        return self._clock.read(self._port.bus_us())

    def publish(self, channel: Channel[M], message: M) -> None:
        """Send a message by wire or by radio."""
        port = self._port
        if channel.wired:
            port.publish(channel, message)
            return
        # Numbered before the radio, so that the others see what it loses; its luck hangs on every
        # message, also on those that nobody hears.
        name, now_us = port.number(channel, message), port.bus_us()
        arrivals_us = self._radio.from_robot.arrivals(now_us, self._faults.at(now_us).loss)
        if name not in port.audience:
            return
        data = message.encode()
        for at_us in arrivals_us:
            if at_us <= now_us:
                port.send(name, data)
            else:
                port.deliver_at(at_us, lambda data, _: port.send(name, data), data)

    def subscribe(self, channel: Channel[M], handler: Callable[[M], None]) -> None:
        """Call ``handler`` with every decoded message of a channel, as it arrives at the board."""
        self._route(channel)
        self._port.subscribe(channel, handler)

    def subscribe_raw(self, channel: Channel[M], handler: RawHandler) -> None:
        """Call ``handler`` with every message of a channel as bytes, and the board's time."""
        self._route(channel)
        read = self._clock.read
        self._port.subscribe_raw(channel, lambda name, data, at: handler(name, data, read(at)))

    def every(self, rate_hz: float, tick: Tick) -> None:
        """Call ``tick`` at absolute deadlines, told in the board's time.

        They keep the pace of the bus: on a real board motor ticks and encoder readings hang on one
        crystal, and the plant's encoders could not slide along with another.
        """
        read = self._clock.read
        self._port.every(rate_hz, lambda bus_us: tick(read(bus_us)))

    def _route(self, channel: Channel[M]) -> None:
        """Let a channel's messages come by radio, or be stamped where the board reads them."""
        subscription = self._port.subscription(channel)
        if channel.wired:
            subscription.amend = self._restamped
        else:
            subscription.arrive = partial(self._deliver_by_radio, subscription.receive)

    def _restamped(self, data: bytes, utime: int) -> bytes:
        return restamp(data, self._clock.read(utime))

    def _deliver_by_radio(self, receive: Deliver, data: bytes, sent_us: int) -> None:
        """Hand a message over once it has arrived: later, twice, or never."""
        loss = self._faults.at(sent_us).loss
        for at_us in self._radio.to_robot.arrivals(sent_us, loss):
            if at_us <= sent_us:
                receive(data, at_us)
            else:
                self._port.deliver_at(at_us, receive, data)

    def _on_fault(self, message: lcmtypes.fault_t) -> None:
        self._faults.obey(message, self._port.bus_us())


def emulated_board(config: LabConfig) -> Wrap | None:
    """Return what wraps a port into that of a simulated board; None where nothing is simulated."""
    simulation, seed = config.simulation, config.seed
    return None if simulation is None else lambda port: EmulatedBoard(port, simulation, seed)

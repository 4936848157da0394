"""One channel that a node listens to: what each message goes through before a handler has it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from koopman_lab.bus.header import header_reader, restamp
from koopman_lab.bus.node import RawHandler
from koopman_lab.bus.sequence import SequenceCounter
from koopman_lab.emulation.drifting_clock import DriftingClock
from koopman_lab.emulation.wire import Wire, from_log


class Subscription:
    """Sorts out what is not for the node, counts what is missing, and calls the handlers.

    Parameters
    ----------
    name
        Of the channel, on the bus.
    message_type
        Of the channel.
    clock
        The node's own, if it is not that of the bus.
    by_radio
        Whether the radio lies before it.
    wire
        What keeps a log off it, if it is a wire's end.
    by_hand
        Whether a person does it to the robot, so that a log must not do it again.
    restamped
        Whether a board reads it itself, and so stamps it by its own clock.
    """

    def __init__(
        self,
        name: str,
        message_type: Any,
        clock: DriftingClock | None,
        *,
        by_radio: bool,
        wire: Wire | None,
        by_hand: bool,
        restamped: bool,
    ) -> None:
        self.by_radio = by_radio
        self.counter = SequenceCounter()
        self.undecodable = 0
        """Were no message of the channel's type. Only raw handlers have them."""
        self.raw_handlers: list[RawHandler] = []
        self.handlers: list[Callable[[Any], None]] = []
        """Called with the decoded message, after the raw ones."""
        self._name = name
        self._decode = message_type.decode
        self._header = header_reader(message_type)
        self._clock = clock
        self._wire = wire
        self._by_hand = by_hand
        self._stamping_clock = clock if restamped else None

    def receive(self, data: bytes, arrived_us: int) -> None:
        """Hand a message that arrives at ``arrived_us`` of the bus to the handlers."""
        header = self._header(data)
        if header is None:
            self.undecodable += 1
        else:
            utime, sequence = header
            if self._wire is not None and not self._wire.takes(utime, arrived_us):
                return
            if self._by_hand and from_log(utime, arrived_us):
                return
            if self._stamping_clock is not None:
                data = restamp(data, self._stamping_clock.read(utime))
            self.counter.update(sequence)
        for handle_raw in self.raw_handlers:
            own_us = arrived_us if self._clock is None else self._clock.read(arrived_us)
            handle_raw(self._name, data, own_us)
        if header is None or not self.handlers:
            return
        message = self._decode(data)
        for handle in self.handlers:
            handle(message)

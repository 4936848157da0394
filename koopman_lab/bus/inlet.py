"""One channel that a node listens to: what each message goes through before a handler has it."""

from __future__ import annotations

import struct
from collections.abc import Callable
from typing import Any

from koopman_lab.bus.clock import DriftingClock
from koopman_lab.bus.node import RawHandler
from koopman_lab.bus.sequence import SMALLEST_MESSAGE, SequenceCounter, peek, restamp
from koopman_lab.bus.wire import Wire, from_log


class Inlet:
    """Sorts out what is not for the node, counts what is missing, and calls the handlers.

    Parameters
    ----------
    name
        Of the channel, on the bus.
    decode
        Of the channel's type.
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
        decode: Callable[[bytes], Any],
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
        self.raw_handlers: list[RawHandler] = []
        self.handlers: list[Callable[[Any], None]] = []
        """Called with the decoded message, after the raw ones."""
        self._name = name
        self._decode = decode
        self._clock = clock
        self._wire = wire
        self._by_hand = by_hand
        self._stamping_clock = clock if restamped else None

    def receive(self, data: bytes, arrived_us: int) -> None:
        """Hand a message that arrives at ``arrived_us`` of the bus to the handlers."""
        if len(data) >= SMALLEST_MESSAGE:
            utime, sequence = peek(data)
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
        if not self.handlers:
            return
        try:
            message = self._decode(data)
        except (ValueError, struct.error):
            self.undecodable += 1
            return
        for handle in self.handlers:
            handle(message)

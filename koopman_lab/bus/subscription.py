"""One channel that a node listens to: what each message goes through before a handler has it."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from koopman_lab.bus.header import header_reader
from koopman_lab.bus.node import RawHandler
from koopman_lab.bus.publishers import Publishers
from koopman_lab.bus.replay_guard import ReplayGuard
from koopman_lab.bus.sequence import PLACE

if TYPE_CHECKING:
    from koopman_lab.bus.admission import Admission

Deliver = Callable[[bytes, int], None]
"""Called with the bytes of a message and the time in us."""

Amend = Callable[[bytes, int], bytes]
"""Called with the bytes of a message and its ``utime`` (us); returns those to go on with."""


class Subscription:
    """Sorts out what is not for the node, counts what is missing, and calls the handlers.

    Who wraps a port may put something of its own before it (:attr:`arrive`) and into it
    (:attr:`amend`).

    Parameters
    ----------
    name
        The channel's name on the bus.
    message_type
        The class of the channel's messages.
    """

    def __init__(self, name: str, message_type: Any) -> None:
        self.publishers = Publishers()
        self.counter = self.publishers.counter
        self.undecodable = 0
        """Were no message of the channel's type. Only raw handlers have them."""
        self.raw_handlers: list[RawHandler] = []
        self.handlers: list[Callable[[Any], None]] = []
        """Called with the decoded message, after the raw ones."""
        self.guard: ReplayGuard | None = None
        """What keeps a log off the handlers, where they act on what they hear."""
        self.amend: Amend | None = None
        """What changes each message before it is handed to handlers."""
        self.arrive: Deliver = self.receive
        """What takes the channel's messages off the bus."""
        self.admission: Admission | None = None
        """What lets messages in before anything else has them, where the lab has a key."""
        self._name = name
        self._decode = message_type.decode
        self._read_header = header_reader(message_type)

    def receive(self, data: bytes, arrived_us: int) -> None:
        """Hand a message that arrives at ``arrived_us`` of the bus to the handlers."""
        header = self._read_header(data)
        if header is None:
            self.undecodable += 1
        else:
            utime, sequence = header
            if self.guard is not None and not self.guard.accepts(utime, arrived_us):
                return
            if self.amend is not None:
                data = self.amend(data, utime)
            counter = self.counter
            if sequence == counter.next_number:
                # As update() does with nearly all messages, without two calls for each.
                counter.next_number = sequence + 1
                counter.stamps[sequence & PLACE] = utime
            else:
                self.publishers.take(sequence, utime, arrived_us)
        for handle_raw in self.raw_handlers:
            handle_raw(self._name, data, arrived_us)
        if header is None or not self.handlers:
            return
        message = self._decode(data)
        for handle in self.handlers:
            handle(message)

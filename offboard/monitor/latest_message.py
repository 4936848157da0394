"""The newest message of a channel, decoded only when somebody looks at it."""

from __future__ import annotations

import contextlib
import struct
from typing import Generic

from koopman_lab.bus.channel import Channel, M
from koopman_lab.units import US_PER_S


class LatestMessage(Generic[M]):
    """Keeps the newest message.

    Cameras and motor loop speak ten times as often as a person can look.
    """

    def __init__(self, channel: Channel[M]) -> None:
        self.channel = channel
        self.arrived_us = 0
        """When it arrived (us)."""
        self._data: bytes | None = None
        self._message: M | None = None

    def take(self, data: bytes, arrived_us: int) -> None:
        """Take a message that arrived at ``arrived_us``."""
        self._data, self.arrived_us = data, arrived_us

    def read(self) -> M | None:
        """Return the newest message that can be decoded, None if there was none."""
        if self._data is not None:
            with contextlib.suppress(ValueError, struct.error):
                self._message = self.channel.type.decode(self._data)
            self._data = None
        return self._message

    def young(self, now_us: int, longest_s: float) -> M | None:
        """Return the message if it arrived no longer ago than this."""
        message = self.read()
        return message if now_us - self.arrived_us <= longest_s * US_PER_S else None

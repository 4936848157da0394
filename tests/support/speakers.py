"""Streams of messages as one or several publishers send them, and as they arrive."""

from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np

from koopman_lab.bus.channel import Channel
from koopman_lab.bus.publishers import Publishers, StreamIdentity
from koopman_lab.config.simulation import RadioLink
from koopman_lab.emulation.radio import Radio


class Said(NamedTuple):
    """A message: when it arrives (us), its number, and its stamp (us)."""

    arrived_us: int
    sequence: int
    utime: int


def speak(
    rate_hz: float, seconds: float, *, first: int = 0, start_us: int = 0, clock_us: int = 0
) -> list[Said]:
    """Return what one publisher says: numbers from ``first``, on a clock ``clock_us`` ahead."""
    times = (start_us + round(k * 1e6 / rate_hz) for k in range(round(rate_hz * seconds)))
    return [Said(t, first + k, t + clock_us) for k, t in enumerate(times)]


def by_radio(said: Iterable[Said], seed: int, **settings: float) -> list[Said]:
    """Return what a bad radio makes of it."""
    link = RadioLink(**(dict.fromkeys(RadioLink.model_fields, 0.0) | settings))
    radio = Radio(link, np.random.default_rng(seed))
    return [m._replace(arrived_us=at) for m in said for at in radio.arrivals(m.arrived_us)]


class Ear:
    """Hears messages in the order of their arrival, and says at each who speaks."""

    def __init__(self, *streams: Iterable[Said]) -> None:
        self.publishers = Publishers()
        self.heard: list[tuple[int, StreamIdentity]] = []
        """When each message arrived (us), and who speaks then."""
        order = [message for stream in streams for message in stream]
        for message in sorted(order, key=lambda message: message.arrived_us):
            self.publishers.take(message.sequence, message.utime, message.arrived_us)
            self.heard.append((message.arrived_us, self.publishers.identity(message.arrived_us)))

    def counts(self, after_us: int = 0) -> set[int]:
        """Return how many were said to speak, from some time on."""
        return {identity.publishers for at_us, identity in self.heard if at_us >= after_us}

    def numberings(self) -> set[str]:
        """Return all that was said of the numbers."""
        return {identity.numbering for _, identity in self.heard}


def encoded(channel: Channel[Any], message: Said) -> bytes:
    """Return a message of a channel with this number and stamp."""
    filled = channel.type()
    filled.utime, filled.sequence = message.utime, message.sequence
    data: bytes = filled.encode()
    return data

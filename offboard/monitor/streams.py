"""How well each channel on the bus flows: rate, jitter, loss, size, age."""

from __future__ import annotations

from array import array
from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from koopman_lab.bus.channel import Channel
from koopman_lab.bus.channels import split_name
from koopman_lab.bus.header import header_reader
from koopman_lab.bus.publishers import (
    GONE_S,
    NamedIdentity,
    Numbering,
    Publishers,
    StreamIdentity,
    identity_faults,
)
from koopman_lab.config.schema import LabConfig
from koopman_lab.errors import BusError
from koopman_lab.units import US_PER_S

WINDOW_S = 5.0
"""Rate and jitter are those of so long, or of the last ``MOST_ARRIVALS`` messages."""
SHORTEST_S = 0.1
"""Over less nobody knows a rate: it may be a burst, or what came at once."""
MOST_ARRIVALS = 512
MOST_STREAMS = 512
"""Names of channels are free on a bus: who invents them endlessly fills no memory here."""

GIVES_WAY_S = 10.0
"""Who was silent for so long, a hundred messages of a motor loop, gives its place to who speaks, if
there is no other."""
LOOK_S = 1.0
"""So often a place is looked for."""
MOST_REFUSALS = 4
"""So many channels are named one by one."""
SILENT_PERIODS = 5
"""Who was silent for so many periods, and a second, is doubted no more."""


class Flow(NamedTuple):
    """How a channel flows at one time.

    Attributes
    ----------
    name
        On the bus.
    messages
        Heard so far.
    rate_hz
        Messages per second; None where too few were heard, or all at once.
    nominal_hz
        As the configuration says; None for a channel that speaks only on events, or none of ours.
    jitter_s
        Standard deviation of the time between arrivals (s).
    lost
        Messages that the sequence numbers show missing; None where several may speak.
    size
        Of the newest message (bytes).
    age_s
        Since the newest message arrived (s); None if there was none yet.
    undecodable
        Were no message of the channel's type, and count for nothing else.
    publishers, numbering
        How many speak at once, and how they number their messages, see
        :class:`~koopman_lab.bus.publishers.StreamIdentity`; None where several may speak.
    refused
        Lack the lab's key, or were sent before, and count for nothing else; 0 where there is none.
    """

    name: str
    messages: int
    rate_hz: float | None
    nominal_hz: float | None
    jitter_s: float | None
    lost: int | None
    size: int
    age_s: float | None
    undecodable: int
    publishers: int | None = None
    numbering: Numbering | None = None
    refused: int = 0


class Stream:
    """What was heard on one channel.

    Parameters
    ----------
    name
        On the bus.
    channel
        The row of the table, None for a channel that is none of this lab.
    """

    def __init__(self, name: str, channel: Channel[Any] | None) -> None:
        self.name = name
        self.channel = channel
        self.count = 0
        self.heard_us = 0
        """When the newest message arrived (us)."""
        self.utime = 0
        """When the newest message was stamped (us), by its sender's clock."""
        self.refused = 0
        """Messages that lack the lab's key, or were sent before."""
        self.refused_us: int | None = None
        """When the newest of them arrived (us)."""
        self._undecodable = 0
        self._size = 0
        self._header = None if channel is None else header_reader(channel.type)
        self._arrivals = array("q", bytes(8 * MOST_ARRIVALS))  # a ring: the oldest is overwritten
        self._publishers: Publishers | None = None
        if channel is not None and channel.rate != "event":
            self._publishers = Publishers()
        self._has_one_publisher = channel is not None and channel.has_one_publisher

    def take(self, data: bytes, arrived_us: int) -> bool:
        """Take what arrived at ``arrived_us``; return whether it is a message of the channel."""
        if self._header is not None:
            header = self._header(data)
            if header is None:
                self._undecodable += 1
                return False
            self.utime, sequence = header
            if self._publishers is not None:
                self._publishers.take(sequence, self.utime, arrived_us)
        self._arrivals[self.count % MOST_ARRIVALS] = arrived_us
        self.count += 1
        self._size, self.heard_us = len(data), arrived_us
        return True

    def forget_numbers(self) -> None:
        """Take the next message for the first, whatever its number: a log goes on elsewhere."""
        if self._publishers is not None:
            self._publishers = Publishers()

    def nominal_hz(self, config: LabConfig) -> float | None:
        """Return the rate that the configuration says, None where it says none."""
        return None if self.channel is None else self.channel.rate_hz(config)

    def flow(self, now_us: int, config: LabConfig) -> Flow:
        """Return how it flows at ``now_us``."""
        arrivals = np.frombuffer(self._arrivals, np.int64)[: self.count]
        if self.count > MOST_ARRIVALS:
            arrivals = np.roll(arrivals, -(self.count % MOST_ARRIVALS))
        publishers, numbering = self._identity(now_us, config) or (None, None)
        steps = np.diff(arrivals[arrivals >= now_us - WINDOW_S * US_PER_S])
        return Flow(
            self.name,
            self.count,
            _rate_hz(steps),
            self.nominal_hz(config),
            float(steps.std()) / US_PER_S if len(steps) > 1 else None,
            None if self._publishers is None else self._publishers.counter.lost,
            self._size,
            (now_us - self.heard_us) / US_PER_S if self.count else None,
            self._undecodable,
            publishers,
            numbering,
            self.refused,
        )

    def _identity(self, now_us: int, config: LabConfig) -> StreamIdentity | None:
        """Return who speaks, None where several may; a stream that fell silent is clear."""
        if self._publishers is None or not self._has_one_publisher:
            return None
        periods_s = SILENT_PERIODS / (self.nominal_hz(config) or 1.0)
        silent = now_us - self.heard_us > max(GONE_S, periods_s) * US_PER_S
        return StreamIdentity() if silent else self._publishers.identity(now_us)


class Streams:
    """All channels on a bus, those of other programs included."""

    def __init__(self) -> None:
        self._streams: dict[str, Stream] = {}
        self._look_us = 0
        self.full_us: int | None = None
        """When the newest message came that found no place (us)."""

    def take(self, name: str, data: bytes, arrived_us: int) -> Stream | None:
        """Take a message; return its stream.

        None if it is no message of its channel, or there are too many streams.
        """
        stream = self._stream(name, arrived_us)
        return stream if stream is not None and stream.take(data, arrived_us) else None

    def refuse(self, name: str, data: bytes, arrived_us: int) -> None:
        """Count a message that lacks the lab's key, or was sent before."""
        del data
        stream = self._stream(name, arrived_us)
        if stream is not None:
            stream.refused += 1
            stream.refused_us = arrived_us

    def refused_since(self, since_us: int) -> dict[str, int]:
        """Return by channel how many were refused in all, where one was since then (us)."""
        return {
            name: stream.refused
            for name, stream in sorted(self._streams.items())
            if stream.refused_us is not None and stream.refused_us >= since_us
        }

    def _stream(self, name: str, arrived_us: int) -> Stream | None:
        """Return the stream of a channel, None if there are too many."""
        stream = self._streams.get(name)
        if stream is None:
            if len(self._streams) == MOST_STREAMS and not self._make_room(arrived_us):
                self.full_us = arrived_us
                return None
            stream = self._streams[name] = Stream(name, _channel(name))
        return stream

    def _make_room(self, now_us: int) -> bool:
        """Forget who was silent for long; return whether there is a place now."""
        if now_us < self._look_us:
            return False
        self._look_us = now_us + round(LOOK_S * US_PER_S)
        heard_us = now_us - GIVES_WAY_S * US_PER_S
        self._streams = {n: s for n, s in self._streams.items() if s.heard_us > heard_us}
        return len(self._streams) < MOST_STREAMS

    def flows(self, now_us: int, config: LabConfig) -> list[Flow]:
        """Return how each channel flows, in alphabetical order."""
        return [self._streams[name].flow(now_us, config) for name in sorted(self._streams)]


def refusal_line(refused: Mapping[str, int]) -> str:
    """Return in words on which channels messages lack the key; empty where none do."""
    if not refused:
        return ""
    shown = [f"{name} ({count})" for name, count in refused.items()][:MOST_REFUSALS]
    more = f" and {len(refused) - len(shown)} more" if len(refused) > len(shown) else ""
    return (
        f"messages without the lab's key, or sent again, are not believed: {', '.join(shown)}{more}"
    )


def identity_lines(flows: Iterable[Flow]) -> list[str]:
    """Return in words what is wrong with who speaks, a line for each robot and kind of fault."""
    return identity_faults(
        NamedIdentity(
            flow.name,
            channel,
            StreamIdentity(flow.publishers, flow.numbering),
            flow.rate_hz,
            flow.nominal_hz,
        )
        for flow in flows
        if flow.publishers is not None
        and flow.numbering is not None
        and (channel := _channel(flow.name)) is not None
    )


def _rate_hz(steps_us: NDArray[np.int64]) -> float | None:
    """Return the rate of what arrived with these steps (us), None where nobody knows it.

    Who looks only now and then finds a batch each time. What the first one holds arrived over a
    time before it that is not known, so only those that follow it count.
    """
    if not len(steps_us):
        return None
    first = int(np.argmax(steps_us >= steps_us.mean() / 2))  # the step behind the first batch
    span_us = int(steps_us[first:].sum())
    return (
        (len(steps_us) - first) * US_PER_S / span_us if span_us >= SHORTEST_S * US_PER_S else None
    )


def _channel(name: str) -> Channel[Any] | None:
    try:
        return split_name(name)[1]
    except BusError:
        return None

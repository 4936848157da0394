"""What a log holds of a channel: counts, rate, and what is missing, without decoding it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from koopman_lab.bus.header import smallest_size
from koopman_lab.bus.publishers import Numbering, Publishers, StreamIdentity, worse
from koopman_lab.bus.sequence import LARGEST_GAP, LATEST
from koopman_lab.data.plausible_stamps import plausible
from koopman_lab.eventlog.message_blocks import Messages
from koopman_lab.units import US_PER_S

LARGEST_PAUSE_S = 60.0
"""A longer step between two messages that follow each other is a clock that was set."""

NOBODY = -1
"""Publisher of a copy, which says nothing new."""
LOOK_US = 500_000
"""So often it is looked who speaks; whoever speaks beside another is known for a second after."""

_HEADER = np.dtype([("fingerprint", ">u8"), ("utime", ">i8"), ("sequence", ">i8")])


@dataclass(frozen=True)
class ChannelSummary:
    """What a log holds of one channel.

    Attributes
    ----------
    count
        Messages stored.
    first_us, last_us
        Smallest and largest utime (us), or times of arrival where the channel is none of this lab.
    rate_hz
        Messages per second between those; None where there is only one instant.
    lost
        Messages that the sequence numbers show missing; 0 where there are none.
    gaps
        Places where messages are missing.
    unreadable
        Messages that are of no layout known here, damaged, or of no time that can be.
    publishers, numbering
        How many spoke at once, and how they numbered their messages, where it was worst; see
        :class:`~koopman_lab.bus.publishers.StreamIdentity`.
    """

    count: int
    first_us: int
    last_us: int
    rate_hz: float | None
    lost: int
    gaps: int
    unreadable: int = 0
    publishers: int = 1
    numbering: Numbering = "counts"

    @property
    def identity(self) -> StreamIdentity:
        """Return who spoke where it was worst."""
        return StreamIdentity(self.publishers, self.numbering)


def summary_of(messages: Messages, message_type: Any | None) -> ChannelSummary:
    """Return what there is of a channel; ``message_type`` is None if it is none of this lab."""
    times = messages.arrival_us
    missing, jumps_us, identity = np.zeros(0, np.int64), 0, StreamIdentity()
    unreadable = 0
    if message_type is not None:
        headers, arrival_us = _headers(messages, message_type)
        usable = plausible(headers["utime"].astype(np.int64))
        headers, arrival_us = headers[usable], arrival_us[usable]
        unreadable = len(messages) - len(headers)
        if len(headers):
            times = headers["utime"].astype(np.int64)
            sequence = headers["sequence"].astype(np.int64)
            missing, identity = _count(sequence, times, arrival_us)
            jumps_us = _clock_jumps_us(times, sequence)
    first_us, last_us = int(times.min()), int(times.max())
    span_us = last_us - first_us - jumps_us
    return ChannelSummary(
        len(messages),
        first_us,
        last_us,
        (len(times) - 1) * US_PER_S / span_us if span_us else None,
        int(missing.sum()),
        len(missing),
        unreadable,
        *identity,
    )


def _headers(messages: Messages, message_type: Any) -> tuple[NDArray[np.void], NDArray[np.int64]]:
    """Return what the messages begin with and when they arrived (us).

    Those are left out that are none of the type: damaged bytes inside a message leave its frame
    intact, and no number to count by.
    """
    whole = messages.sizes >= smallest_size(message_type)
    headers = messages.heads(whole, _HEADER)
    known = headers["fingerprint"] == int.from_bytes(message_type._get_packed_fingerprint(), "big")
    return headers[known], messages.arrival_us[whole][known]


def _clock_jumps_us(times: NDArray[np.int64], sequence: NDArray[np.int64]) -> int:
    """Return how far a stream's clock was set forward in all: steps that no gap accounts for."""
    steps, numbers = np.diff(times), np.diff(sequence)
    forward = numbers > 0
    if not forward.any():
        return 0
    steps, numbers = steps[forward], numbers[forward]
    expected = np.median(steps / numbers) * numbers
    excess = steps - expected
    return int(excess[excess > LARGEST_PAUSE_S * US_PER_S].sum())


def _count(
    sequence: NDArray[np.int64], times: NDArray[np.int64], arrival_us: NDArray[np.int64]
) -> tuple[NDArray[np.int64], StreamIdentity]:
    """Return the size of each gap, of each publisher on its own, and who spoke at most at once."""
    kept = _no_slips(sequence)
    sequence, times, arrival_us = sequence[kept], times[kept], arrival_us[kept]
    steps = np.diff(sequence.view(np.uint64))  # as far apart as int64 can be
    publishers, identity = [sequence], StreamIdentity()
    rising = bool(np.all((sequence[1:] > sequence[:-1]) & (steps <= LARGEST_GAP)))
    if not rising or np.any(times[1:] == times[:-1]):
        publisher_of, identity = _publishers(sequence, times, arrival_us)
        if not rising:
            everybody = range(publisher_of.max() + 1)
            publishers = [np.unique(sequence[publisher_of == k]) for k in everybody]
    missing = np.concatenate([np.diff(numbers) for numbers in publishers]) - 1
    return missing[missing > 0], identity


def _publishers(
    sequence: NDArray[np.int64], times: NDArray[np.int64], arrival_us: NDArray[np.int64]
) -> tuple[NDArray[np.int64], StreamIdentity]:
    """Return whose each message (n,) is, and who spoke when most spoke at once.

    Publishers are counted from 0; a copy is :data:`NOBODY`'s.
    """
    heard, publisher = Publishers(), np.zeros(len(sequence), np.int64)
    counter, split, copies = heard.counter, None, 0
    worst, look_us = StreamIdentity(), int(arrival_us[0]) + LOOK_US
    messages = zip(sequence.tolist(), times.tolist(), arrival_us.tolist(), strict=True)
    for k, (number, utime, arrived_us) in enumerate(messages):
        heard.take(number, utime, arrived_us)
        if arrived_us >= look_us:
            worst, look_us = worse(worst, heard.identity(arrived_us)), arrived_us + LOOK_US
        if counter.copies != copies:
            copies, publisher[k] = counter.copies, NOBODY
            continue
        if counter.newest_split is not None and counter.newest_split is not split:
            split = first, seeming, actual = counter.newest_split
            before = publisher[:k]
            before[(before == seeming) & (sequence[:k] >= first)] = actual
        publisher[k] = counter.publisher
    return publisher, worse(worst, heard.identity(int(arrival_us[-1])))


def _no_slips(sequence: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Return which numbers are no single far lower ones between rising neighbours.

    Such a one is damage, and no publisher that started again, unless numbers next to it are there.
    """
    previous, current, following = sequence[:-2], sequence[1:-1], sequence[2:]
    slips = np.flatnonzero((current < previous - LATEST) & (previous < following))
    has_neighbour = np.isin(current[slips] - 1, sequence) | np.isin(current[slips] + 1, sequence)
    kept = np.ones(len(sequence), bool)
    kept[1 + slips[~has_neighbour]] = False
    return kept

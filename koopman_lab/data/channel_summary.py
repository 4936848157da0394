"""What a log holds of a channel: counts, rate, and what is missing, without decoding it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from koopman_lab.bus.header import smallest_size
from koopman_lab.bus.sequence import LARGEST_GAP, LATEST, SequenceCounter
from koopman_lab.eventlog.message_blocks import Messages
from koopman_lab.units import US_PER_S

LARGEST_PAUSE_S = 60.0
"""A longer step between two messages that follow each other is a clock that was set."""

NOBODY = -1
"""Publisher of a copy, which says nothing new."""

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
        Messages that are of no layout known here, or damaged.
    """

    count: int
    first_us: int
    last_us: int
    rate_hz: float | None
    lost: int
    gaps: int
    unreadable: int = 0


def summary_of(messages: Messages, message_type: Any | None) -> ChannelSummary:
    """Return what there is of a channel; ``message_type`` is None if it is none of this lab."""
    times = messages.arrival_us
    missing, jumps_us = np.zeros(0, np.int64), 0
    headers = None if message_type is None else _headers(messages, message_type)
    unreadable = 0 if headers is None else len(messages) - len(headers)
    if headers is not None and len(headers):
        times = headers["utime"].astype(np.int64)
        sequence = headers["sequence"].astype(np.int64)
        missing, jumps_us = _gap_sizes(sequence, times), _clock_jumps_us(times, sequence)
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
    )


def _headers(messages: Messages, message_type: Any) -> NDArray[np.void]:
    """Return what the messages begin with, those left out that are none of the type.

    Damaged bytes inside a message leave its frame intact, and no number to count by.
    """
    headers = messages.heads(messages.sizes >= smallest_size(message_type), _HEADER)
    known = headers["fingerprint"] == int.from_bytes(message_type._get_packed_fingerprint(), "big")
    ours: NDArray[np.void] = headers[known]
    return ours


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


def _gap_sizes(sequence: NDArray[np.int64], times: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the size of each gap, of each publisher on its own if there are several."""
    kept = _no_slips(sequence)
    sequence, times = sequence[kept], times[kept]
    steps = np.diff(sequence.view(np.uint64))  # as far apart as int64 can be
    if np.all((sequence[1:] > sequence[:-1]) & (steps <= LARGEST_GAP)):
        publishers = [sequence]
    else:
        publisher_of = _publishers(sequence, times)
        publishers = [np.unique(sequence[publisher_of == k]) for k in range(publisher_of.max() + 1)]
    missing = np.concatenate([np.diff(numbers) for numbers in publishers]) - 1
    return missing[missing > 0]


def _publishers(sequence: NDArray[np.int64], times: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return whose each message (n,) is, counted from 0; :data:`NOBODY` where it is a copy."""
    counter, publisher = SequenceCounter(), np.zeros(len(sequence), np.int64)
    split = None
    copies = 0
    for k, (number, utime) in enumerate(zip(sequence.tolist(), times.tolist(), strict=True)):
        counter.update(number, utime)
        if counter.copies != copies:
            copies, publisher[k] = counter.copies, NOBODY
            continue
        if counter.newest_split is not None and counter.newest_split is not split:
            split = first, seeming, actual = counter.newest_split
            before = publisher[:k]
            before[(before == seeming) & (sequence[:k] >= first)] = actual
        publisher[k] = counter.publisher
    return publisher


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

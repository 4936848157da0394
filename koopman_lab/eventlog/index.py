"""Where the messages of a log lie, channel by channel, found all at once.

An hour's session holds more than two million events; stepping from one to the next in Python takes
longer than everything that is done with them.
"""

from __future__ import annotations

from array import array
from collections import defaultdict
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from koopman_lab.eventlog.eventlog import (
    LONGEST_NAME,
    SYNC_WORD,
    Damage,
    channel_name,
    load_log,
    scan,
)
from koopman_lab.eventlog.message_blocks import Indices, Messages, bytes_at
from koopman_lab.eventlog.older_layouts import messages_in_present_layout

_HEADER = np.dtype(
    [("sync", ">u4"), ("number", ">i8"), ("time", ">i8"), ("name", ">u4"), ("data", ">u4")]
)
_CHUNK = 1 << 20
"""Bytes searched at a time; what fits into the processor's cache."""
_MOST_CHANNELS = 256
"""Logs with more are none of a lab; they are read event by event."""


def index_files(
    files: Sequence[Path], *, salvage: bool, damage: list[Damage] | None = None
) -> dict[str, Messages]:
    """Return the messages of a log that may go on in several files; see :func:`index_log`.

    Messages of older layouts come in those of today
    (:mod:`~koopman_lab.eventlog.older_layouts`).

    Raises
    ------
    LogError
        If a file is no log, or as :func:`index_log`.
    """
    logs = [load_log(file) for file in files]
    indexes = [
        index_log(file, log, salvage=salvage, damage=damage)
        for file, log in zip(files, logs, strict=True)
    ]
    return {name: messages_in_present_layout(m) for name, m in _joined(logs, indexes).items()}


def _joined(logs: Sequence[bytes], indexes: Sequence[dict[str, Messages]]) -> dict[str, Messages]:
    """Return by channel the messages of all files."""
    if len(indexes) == 1:
        return indexes[0]
    block, begin = b"".join(logs), 0
    pieces: dict[str, list[Messages]] = defaultdict(list)
    for log, messages in zip(logs, indexes, strict=True):
        for name, m in messages.items():
            pieces[name].append(Messages(block, m.starts + begin, m.stops + begin, m.arrival_us))
        begin += len(log)
    return {
        name: Messages(
            block,
            np.concatenate([m.starts for m in parts]),
            np.concatenate([m.stops for m in parts]),
            np.concatenate([m.arrival_us for m in parts]),
        )
        for name, parts in sorted(pieces.items())
    }


def index_log(
    path: Path | str, log: bytes, *, salvage: bool, damage: list[Damage] | None = None
) -> dict[str, Messages]:
    """Return the messages of a log by channel, in the order of the file.

    The result is that of :func:`.eventlog.scan`; only damaged logs take as long.

    Parameters
    ----------
    path
        For messages.
    log
        From :func:`~koopman_lab.eventlog.eventlog.load_log`.
    salvage, damage
        As for :func:`~koopman_lab.eventlog.eventlog.read_events`.

    Raises
    ------
    LogError
        If the log is damaged and ``salvage`` is False, or holds no intact event.
    """
    messages = _index_unbroken(log)
    if messages is None:
        messages = _event_by_event(path, log, salvage=salvage, damage=damage)
    return dict(sorted(messages.items()))


def _index_unbroken(log: bytes) -> dict[str, Messages] | None:
    """Return the messages if events follow each other from the first byte to the last."""
    begins = _sync_words(log)
    # More than events can be: what is kept of each would take more memory than the log.
    too_many = len(begins) > len(log) // 8 + _CHUNK // 8
    if too_many or not len(begins) or begins[0] != 0:
        return None
    headers = bytes_at(log, begins, _HEADER.itemsize).view(_HEADER)
    sizes = headers["name"].astype(np.int64)
    starts = begins + _HEADER.itemsize + sizes
    stops = starts + headers["data"]
    if stops[-1] != len(log) or not np.array_equal(stops[:-1], begins[1:]):
        # A sync word may stand inside a message by chance.
        chain = _chain(begins, stops, len(log))
        if chain is None:
            return None
        begins, sizes, starts, stops = begins[chain], sizes[chain], starts[chain], stops[chain]
        headers = headers[chain]
        # Or a damaged length reaches over whole events, which their numbers tell.
        if np.any(np.diff(headers["number"].astype(np.int64)) != 1):
            return None
    if sizes.min() < 1 or sizes.max() > LONGEST_NAME:
        return None
    arrival_us = headers["time"].astype(np.int64)
    by_name = _by_name(log, begins + _HEADER.itemsize, sizes)
    if by_name is None:
        return None
    return {
        name: Messages(log, starts[events], stops[events], arrival_us[events])
        for name, events in by_name.items()
    }


def _sync_words(log: bytes) -> Indices:
    """Return every byte offset at which a sync word stands with room for a header behind it."""
    octets = np.frombuffer(log, np.uint8)[: max(len(log) - _HEADER.itemsize + 1, 0)]
    first = SYNC_WORD >> 24
    places = [np.zeros(0, np.int64)]
    for chunk in range(0, len(octets), _CHUNK):
        candidates = chunk + np.flatnonzero(octets[chunk : chunk + _CHUNK] == first)
        places.append(candidates[bytes_at(log, candidates, 4).view(">u4") == SYNC_WORD])
    return np.concatenate(places)


def _chain(begins: Indices, stops: Indices, length: int) -> list[int] | None:
    """Return the events that lead from the first byte to the last, None if there is a break."""
    places = np.searchsorted(begins, stops)
    leads = begins[np.minimum(places, len(begins) - 1)] == stops
    following = np.where(leads, places, np.where(stops == length, len(begins), -1)).tolist()
    chain, event = [], 0
    while 0 <= event < len(begins):
        chain.append(event)
        event = following[event]
    return chain if event == len(begins) else None


def _by_name(log: bytes, begins: Indices, sizes: Indices) -> dict[str, NDArray[np.intp]] | None:
    """Return the events of each channel; None if a name is none or there are too many of them."""
    places: dict[str, NDArray[np.intp]] = {}
    for size in np.flatnonzero(np.bincount(sizes)).tolist():
        events = np.flatnonzero(sizes == size)
        names = bytes_at(log, begins[events], size, "S")
        while len(events):
            name = channel_name(log[begins[events[0]] : begins[events[0]] + size])
            if not name or len(places) == _MOST_CHANNELS:
                return None
            same = names == names[0]
            places[name] = events[same]
            events, names = events[~same], names[~same]
    return places


def _event_by_event(
    path: Path | str, log: bytes, *, salvage: bool, damage: list[Damage] | None
) -> dict[str, Messages]:
    # Of each channel: starts, stops, times of arrival.
    numbers: dict[str, tuple[array[int], array[int], array[int]]] = defaultdict(
        lambda: (array("q"), array("q"), array("q"))
    )
    for frame in scan(path, log, salvage=salvage, damage=damage):
        starts, stops, arrivals = numbers[frame.channel]
        starts.append(frame.start)
        stops.append(frame.stop)
        arrivals.append(frame.timestamp_us)
    return {
        name: Messages(log, *(np.array(column, np.int64) for column in columns))
        for name, columns in numbers.items()
    }

"""Standard LCM event logs: read in one go, salvaged when damaged.

An event is a sync word, event number, time of arrival, length of the channel name, length of the
data (all big-endian), then the name and the data. The files are those of lcm-logger and
lcm-logplayer.

A log may be anybody's: its lengths are held against the file, and no work or memory grows faster
than the file does.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

from koopman_lab.errors import LogError
from koopman_lab.files import open_file
from koopman_lab.units import US_PER_S

SYNC_WORD = 0xEDA1DA01
HEADER = struct.Struct(">IqqII")
_BEGINNING = struct.Struct(">IQ")
"""Sync word and number, which two's complement packs alike with and without sign."""
LONGEST_NAME = 63
"""LCM refuses longer channel names."""
MOST_SEARCHES = 32
"""How often a log may be searched from end to end to salvage it; one that was cut, overwritten or
lost sectors needs a few."""
_SYNC_BYTES = SYNC_WORD.to_bytes(4, "big")


class Event(NamedTuple):
    """One message as it was stored.

    ``timestamp_us`` is the time of arrival at the logger; what is measured carries its own time.
    """

    number: int
    timestamp_us: int
    channel: str
    data: bytes


class Frame(NamedTuple):
    """Where an event lies in a log: it begins at ``begin``, its data are ``log[start:stop]``."""

    number: int
    timestamp_us: int
    channel: str
    begin: int
    start: int
    stop: int


@dataclass(frozen=True)
class Damage:
    """A stretch of a log that holds no intact event.

    Attributes
    ----------
    offset, size
        First byte and number of bytes passed over.
    after_us, before_us
        Times of arrival (us) of the intact events on either side; None at an end of the log.
    """

    offset: int
    size: int
    after_us: int | None
    before_us: int | None

    @property
    def duration_s(self) -> float | None:
        """Return the time between the events on either side (s), None at an end of the log."""
        if self.after_us is None or self.before_us is None:
            return None
        return (self.before_us - self.after_us) / US_PER_S

    def __str__(self) -> str:
        text = f"{self.size} bytes at byte {self.offset}"
        if self.duration_s is not None:
            return f"{text}, {self.duration_s:.3f} s"
        return f"{text}, at the {'start' if self.after_us is None else 'end'}"


def read_events(
    path: Path | str, *, salvage: bool = False, damage: list[Damage] | None = None
) -> Iterator[Event]:
    """Return the events of a log in the order they were written.

    Parameters
    ----------
    path
        The log.
    salvage
        Pass over what is damaged instead of refusing the file.
    damage
        Receives what was passed over, in the order of the file.

    Raises
    ------
    LogError
        At once if there is no such file, it is empty, or it is no event log. While iterating, if
        it is damaged or truncated and ``salvage`` is False; the message names the byte offset and
        the number of intact events before it.
    """
    log = load_log(path)
    frames = scan(path, log, salvage=salvage, damage=damage)
    return (Event(f.number, f.timestamp_us, f.channel, log[f.start : f.stop]) for f in frames)


def load_log(path: Path | str) -> bytes:
    """Return the bytes of a log for :func:`scan`.

    Raises
    ------
    LogError
        If there is no such file or it is empty or holds no event at all.
    """
    try:
        with open_file(Path(path)) as file:
            log = file.read()
    except FileNotFoundError:
        raise LogError(f"{path}: no such log; give the session folder or its session.lcm") from None
    except OSError as error:
        raise LogError(f"{path}: cannot be read as a log: {error.strerror}") from None
    except MemoryError:
        raise LogError(f"{path}: is larger than the memory that is free here") from None
    if not log:
        raise LogError(f"{path}: the log is empty; record the session again")
    if _SYNC_BYTES not in log:
        raise LogError(
            f"{path}: not an LCM event log (no event begins anywhere in its {len(log)} bytes); "
            "give the session.lcm of a session folder"
        )
    return log


def scan(
    path: Path | str, log: bytes, *, salvage: bool, damage: list[Damage] | None = None
) -> Iterator[Frame]:
    """Return where the events lie in the bytes of a log; see :func:`read_events`.

    Parameters
    ----------
    path
        For messages.
    log
        From :func:`load_log`.
    salvage, damage
        As for :func:`read_events`.
    """
    position, events, searched = 0, 0, 0
    last_us: int | None = None
    length = len(log)
    while position < length:
        frame = _frame_at(log, position)
        if frame is not None and _is_followed(log, frame):
            yield frame
            position, events, last_us = frame.stop, events + 1, frame.timestamp_us
            continue
        searched += frame.stop - frame.begin if frame else 0
        if searched > MOST_SEARCHES * length:
            raise LogError(
                f"{path}: damaged throughout, as no accident leaves it: event headers within event "
                f"headers at byte {position} of {length}; record the session again"
            )
        following = _next_frame(log, position)
        end = following.begin if following else length
        if frame is not None and _is_plain(log, frame) and _is_intact(frame, following, end):
            yield frame
            position, events, last_us = frame.stop, events + 1, frame.timestamp_us
        if not salvage:
            raise LogError(
                f"{path}: damaged at byte {position} of {length}, after {events} intact events; "
                "use --salvage to keep every intact event"
            )
        if damage is not None:
            before_us = following.timestamp_us if following else None
            damage.append(Damage(position, end - position, last_us, before_us))
        position = end
    if not events:
        raise LogError(f"{path}: holds no intact event; record the session again")


def _frame_at(log: bytes, begin: int) -> Frame | None:
    """Return the frame whose header begins here, or None if there is no believable one."""
    try:
        sync, number, timestamp_us, name_length, data_length = HEADER.unpack_from(log, begin)
    except struct.error:
        return None
    start = begin + HEADER.size + name_length
    stop = start + data_length
    if sync != SYNC_WORD or name_length > LONGEST_NAME or stop > len(log):
        return None
    name = channel_name(log[begin + HEADER.size : start])
    return Frame(number, timestamp_us, name, begin, start, stop) if name else None


@lru_cache(maxsize=4096)
def channel_name(name: bytes) -> str:
    r"""Return the channel, or an empty string if LCM cannot carry this name.

    Bytes that are no text are written as Python does, as ``\xdc``. Whoever shows a name to a person
    sees to what does not show.
    """
    return "" if b"\0" in name else name.decode(errors="backslashreplace")


def _is_plain(log: bytes, frame: Frame) -> bool:
    """Return whether the name is one that people give; in damaged bytes no other is believed."""
    return (
        frame.channel.isprintable()
        and frame.channel.encode() == log[frame.begin + HEADER.size : frame.start]
    )


def _is_followed(log: bytes, frame: Frame) -> bool:
    """Return whether the next event, or the end, comes just where this one ends."""
    following = _BEGINNING.pack(SYNC_WORD, (frame.number + 1) % 2**64)
    if log.startswith(following, frame.stop):
        return True
    if frame.stop < len(log) and not log.startswith(_SYNC_BYTES, frame.stop):
        return False
    # Some other event comes next. A damaged length may reach over whole events, to just there.
    inside = log.find(following, frame.start, frame.stop)
    return inside < 0 or _frame_at(log, inside) is None


def _next_frame(log: bytes, position: int) -> Frame | None:
    """Return the first frame after the one that should begin at ``position``."""
    begin = log.find(_SYNC_BYTES, position + 1)
    while begin >= 0:
        frame = _frame_at(log, begin)
        if frame is not None and _is_plain(log, frame):
            return frame
        begin = log.find(_SYNC_BYTES, begin + 1)
    return None


def _is_intact(frame: Frame, following: Frame | None, end: int) -> bool:
    """Tell an event before a damaged stretch from one whose own length is damaged.

    The length is too large if it reaches over the next event, and too small if the next event
    bears the next number, since then nothing but this event lies in between.
    """
    if frame.stop > end:
        return False
    return following is None or following.number != frame.number + 1

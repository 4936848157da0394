"""What all formats share: the decoded messages of a log, and what was written of it."""

from __future__ import annotations

import contextlib
import math
import struct
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

from koopman_lab.bus.channel import Channel
from koopman_lab.bus.channels import split_name
from koopman_lab.errors import BusError, LogError
from koopman_lab.eventlog.eventlog import Event
from koopman_lab.files import file_name
from koopman_lab.units import US_PER_S

ARRIVAL = "arrival_us"
"""Column that tables have in front: when the logger received the message (us)."""
NS_PER_US = 1000


class Exported(NamedTuple):
    """What was written.

    Attributes
    ----------
    channels
        Messages by channel.
    left_out
        Messages by channel that are none of this lab, or cannot be decoded.
    without_form
        Messages by channel that the format has no form for.
    """

    channels: dict[str, int]
    left_out: dict[str, int]
    without_form: dict[str, int]

    @classmethod
    def nothing(cls) -> Exported:
        """Return what is written before anything is."""
        return cls({}, {}, {})

    def keep(self, name: str, *, has_form: bool = True) -> None:
        """Count a message of a channel as written, or as one that the format has no form for."""
        counts = self.channels if has_form else self.without_form
        counts[name] = counts.get(name, 0) + 1

    def require_any(self) -> None:
        """Refuse a log of which nothing was written.

        Raises
        ------
        LogError
            Names the channels that there are.
        """
        if not self.channels:
            present = ", ".join((*self.without_form, *self.left_out))
            raise LogError(
                f"no message of this lab to export, only {present}; give the log of a session"
            )


class Decoded(NamedTuple):
    """A message of a log: its event, the robot, the row of the table of channels, the message."""

    event: Event
    robot_name: str
    channel: Channel[Any]
    message: Any


def decoded(events: Iterable[Event], written: Exported) -> Iterator[Decoded]:
    """Give the messages of a log, and count those that cannot be decoded."""
    for event in events:
        entry = _decoded(event)
        if entry is None:
            written.left_out[event.channel] = written.left_out.get(event.channel, 0) + 1
        else:
            yield entry


def _decoded(event: Event) -> Decoded | None:
    with contextlib.suppress(BusError, ValueError, struct.error):
        robot_name, channel = split_name(event.channel)
        return Decoded(event, robot_name, channel, channel.type.decode(event.data))
    return None


def nanoseconds(utime_us: int, latest_ns: int) -> int:
    """Return a time in ns as a format can hold it: from 1970 on, and no later than its latest."""
    return min(max(utime_us, 0) * NS_PER_US, latest_ns)


def seconds_and_nanoseconds(utime_us: int, latest_s: int) -> tuple[int, int]:
    """Return a time as a format can hold it: from 1970 on, and no later than its latest second."""
    seconds, us = divmod(utime_us, US_PER_S)
    if not 0 <= seconds <= latest_s:
        seconds, us = min(max(seconds, 0), latest_s), 0
    return seconds, us * NS_PER_US


def turn_about_z(theta_rad: float) -> tuple[float, float]:
    """Return ``(z, w)`` of the quaternion of a turn about the axis that points up."""
    return math.sin(theta_rad / 2.0), math.cos(theta_rad / 2.0)


def channel_files(folder: Path, channels: Iterable[str], ending: str) -> Iterator[Path]:
    """Give a file for each channel; anybody on the bus can name one."""
    taken: set[str] = set()
    for channel in channels:
        stem = file_name(channel, taken)
        taken.add(stem.lower())
        yield folder / f"{stem}{ending}"


class Column(NamedTuple):
    """One field of the messages of a channel.

    Attributes
    ----------
    name
        Of the field.
    kind
        LCM's name of its type, or of that of its elements, such as ``double``.
    dimensions
        How many dimensions the value of one message has; 0 for a single one.
    values
        Of each message (N,).
    """

    name: str
    kind: str
    dimensions: int
    values: list[Any]


def columns_by_channel(
    events: Iterable[Event], written: Exported
) -> dict[str, tuple[list[int], list[Column]]]:
    """Return by channel the times of arrival (us) and the columns of its messages.

    Raises
    ------
    LogError
        If no message can be decoded.
    """
    tables: dict[str, tuple[list[int], list[Column]]] = {}
    for event, _, channel, message in decoded(events, written):
        if event.channel not in tables:
            tables[event.channel] = [], _empty_columns(channel.type)
        written.keep(event.channel)
        arrivals, columns = tables[event.channel]
        arrivals.append(event.timestamp_us)
        for column in columns:
            column.values.append(getattr(message, column.name))
    written.require_any()
    return tables


def _empty_columns(message_type: Any) -> list[Column]:
    table = zip(
        message_type.__slots__,
        message_type.__typenames__,
        message_type.__dimensions__,
        strict=True,
    )
    return [Column(name, kind, len(shape or ()), []) for name, kind, shape in table]

"""Session logs for other programs: a CSV file a channel (PlotJuggler), or MCAP (Foxglove)."""

from __future__ import annotations

import contextlib
import csv
import io
import json
import struct
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

from koopman_lab.bus.channel import Channel
from koopman_lab.bus.channels import split_name
from koopman_lab.bus.message_values import flat_columns, json_schema, plain_values
from koopman_lab.errors import BusError, LogError
from koopman_lab.eventlog.eventlog import Event
from koopman_lab.files import file_name, replacing, replacing_folder
from koopman_lab.installation import require

ARRIVAL = "arrival_us"
"""First column of each CSV file: when the logger received the message (us)."""
NS_PER_US = 1000
LATEST_NS = (1 << 64) - 1
"""MCAP keeps 64 bits of a time, and none before 1970."""
SEQUENCE_RANGE = 1 << 32
"""MCAP keeps 32 bits of a sequence number."""


class Exported(NamedTuple):
    """What was written.

    Attributes
    ----------
    channels
        Messages by channel.
    left_out
        Messages by channel that are none of this lab, or cannot be decoded.
    """

    channels: dict[str, int]
    left_out: dict[str, int]


class _Decoded(NamedTuple):
    event: Event
    channel: Channel[Any]
    values: dict[str, Any]


def export_csv(events: Iterable[Event], folder: Path) -> Exported:
    """Write a folder with a file ``CHANNEL.csv`` each, whole or not at all.

    What is no letter, digit or one of ``_.-~`` in a channel's name is in hexadecimal in that of its
    file (:func:`~koopman_lab.files.file_name`).

    Raises
    ------
    OSError
        If ``folder`` exists and is not empty, or cannot be written.
    LogError
        If no message can be decoded.
    """
    written = Exported({}, {})
    tables: dict[str, tuple[list[str], list[dict[str, Any]]]] = {}
    for event, _, values in _decoded(events, written):
        columns, rows = tables.setdefault(event.channel, ([ARRIVAL], []))
        row = {ARRIVAL: event.timestamp_us} | dict(flat_columns(values))
        if len(row) > len(columns):  # a list may be longer later
            columns.extend(name for name in row if name not in columns)
        rows.append(row)
    _require_any(written)
    with replacing_folder(folder) as temporary:
        taken: set[str] = set()
        for name, (columns, rows) in tables.items():
            text = io.StringIO()
            writer = csv.DictWriter(text, columns, restval="", lineterminator="\n")
            writer.writeheader()
            writer.writerows(rows)
            stem = file_name(name, taken)  # anybody on the bus can name a channel
            taken.add(stem.lower())
            (temporary / f"{stem}.csv").write_text(text.getvalue())
    return written


def export_mcap(events: Iterable[Event], path: Path) -> Exported:
    """Write an MCAP file whose messages are JSON with a schema, whole or not at all.

    ``publish_time`` is the message's utime and ``log_time`` its time of arrival, as far as the
    format can hold them; the message itself has its utime in full.

    Raises
    ------
    InstallationError
        If the extra mcap is not installed.
    OSError
        If the file cannot be written.
    LogError
        If no message can be decoded.
    """
    require("mcap", "MCAP")
    from mcap.writer import Writer

    written = Exported({}, {})
    numbers: dict[str, int] = {}
    with replacing(path) as file:
        writer: Any = Writer(file)
        writer.start(library="koopman-lab")
        for event, channel, values in _decoded(events, written):
            number = numbers.get(event.channel)
            if number is None:
                schema = writer.register_schema(
                    name=channel.type.__name__,
                    encoding="jsonschema",
                    data=json.dumps(json_schema(channel.type)).encode(),
                )
                number = writer.register_channel(
                    topic=event.channel, message_encoding="json", schema_id=schema
                )
                numbers[event.channel] = number
            writer.add_message(
                channel_id=number,
                log_time=_nanoseconds(event.timestamp_us),
                data=json.dumps(values, allow_nan=False).encode(),
                publish_time=_nanoseconds(values["utime"]),
                sequence=values["sequence"] % SEQUENCE_RANGE,
            )
        writer.finish()
        _require_any(written)
    return written


def _decoded(events: Iterable[Event], written: Exported) -> Iterator[_Decoded]:
    for event in events:
        with contextlib.suppress(BusError, ValueError, struct.error):
            channel = split_name(event.channel)[1]
            values = plain_values(channel.type.decode(event.data))
            written.channels[event.channel] = written.channels.get(event.channel, 0) + 1
            yield _Decoded(event, channel, values)
            continue
        written.left_out[event.channel] = written.left_out.get(event.channel, 0) + 1


def _nanoseconds(utime_us: int) -> int:
    """Return a time as MCAP can hold it, or else the first or the last that it can."""
    return min(max(utime_us, 0) * NS_PER_US, LATEST_NS)


def _require_any(written: Exported) -> None:
    if not written.channels:
        raise LogError(
            f"no message of this lab to export, only {', '.join(written.left_out)}; give the log "
            "of a session"
        )

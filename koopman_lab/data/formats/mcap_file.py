"""An MCAP file for Foxglove: every message as JSON with a schema, and the lab in 3D."""

from __future__ import annotations

import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from mcap.writer import Writer

from koopman_lab.bus.message_values import json_schema, plain_values
from koopman_lab.data.formats.decoded import Decoded, Exported, decoded, nanoseconds
from koopman_lab.data.formats.foxglove_scene import Scene, schema_of
from koopman_lab.eventlog.eventlog import Event
from koopman_lab.files import replacing

LATEST_NS = (1 << 64) - 1
"""MCAP keeps 64 bits of a time, and none before 1970."""
SEQUENCE_RANGE = 1 << 32
"""MCAP keeps 32 bits of a sequence number."""


def write(events: Iterable[Event], path: Path) -> Exported:
    """Write an MCAP file, whole or not at all.

    Every message is there as JSON with a schema under the name of its channel. What can be seen in
    3D stands beside that in Foxglove's own schemas
    (:mod:`~koopman_lab.data.formats.foxglove_scene`). ``publish_time`` is the message's utime and
    ``log_time`` its time of arrival, as far as the format can hold them; the message itself has its
    utime in full.

    Raises
    ------
    OSError
        If the file cannot be written.
    LogError
        If no message can be decoded.
    """
    written, scene = Exported.nothing(), Scene()
    with replacing(path) as file:
        topics = _Topics(file)
        for entry in decoded(events, written):
            channel, message = entry.channel, entry.message
            written.keep(entry.event.channel)
            number = topics.number(
                entry.event.channel,
                "json",
                lambda channel=channel: (
                    channel.type.__name__,
                    "jsonschema",
                    json.dumps(json_schema(channel.type)).encode(),
                ),
            )
            values = json.dumps(plain_values(message), allow_nan=False).encode()
            topics.add(number, entry, values)
            for topic, shown in scene.take(entry.robot_name, channel, message):
                number = topics.number(topic, "protobuf", lambda shown=shown: schema_of(shown))
                topics.add(number, entry, shown.SerializeToString())
        topics.writer.finish()
        written.require_any()
    return written


class _Topics:
    """The topics of one file, registered when they are first needed."""

    def __init__(self, file: Any) -> None:
        self.writer: Any = Writer(file)
        self.writer.start(library="koopman-lab")
        self._numbers: dict[str, int] = {}

    def number(self, topic: str, encoding: str, schema: Any) -> int:
        """Return the number of a topic; ``schema`` returns its schema's name, encoding, data."""
        number = self._numbers.get(topic)
        if number is None:
            name, schema_encoding, data = schema()
            schema_id = self.writer.register_schema(name=name, encoding=schema_encoding, data=data)
            number = self._numbers[topic] = self.writer.register_channel(
                topic=topic, message_encoding=encoding, schema_id=schema_id
            )
        return number

    def add(self, number: int, entry: Decoded, data: bytes) -> None:
        """Write a message that was made of an entry of the log."""
        self.writer.add_message(
            channel_id=number,
            log_time=nanoseconds(entry.event.timestamp_us, LATEST_NS),
            data=data,
            publish_time=nanoseconds(entry.message.utime, LATEST_NS),
            sequence=entry.message.sequence % SEQUENCE_RANGE,
        )

"""Reads MCAP files: those that this lab exported, and those of others with poses and commands."""

from __future__ import annotations

import contextlib
import json
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory as ProtobufDecoders
from mcap_ros2.decoder import DecoderFactory as Ros2Decoders

from koopman_lab.bus.channel import Channel
from koopman_lab.bus.channels import split_name
from koopman_lab.data.formats.decoded import NS_PER_US
from koopman_lab.data.formats.recorded_motion import (
    ACCELERATIONS,
    POSES,
    VELOCITIES,
    RecordedMessage,
)
from koopman_lab.errors import BusError, LogError
from koopman_lab.eventlog.eventlog import Event
from koopman_lab.files import open_file

_NOT_FINITE_ALLOWED = ("double", "float")


def is_of_this_lab(path: Path) -> bool:
    """Return whether a file is MCAP and holds channels of this lab in this lab's own messages.

    Raises
    ------
    LogError
        If an MCAP file cannot be read.
    """
    if path.is_dir():
        return False
    with _reading(path) as reader:
        summary = reader.get_summary()
        if summary is None:
            return False
        return any(
            channel.schema_id in summary.schemas
            and _lab_channel(channel.topic, summary.schemas[channel.schema_id].name) is not None
            for channel in summary.channels.values()
        )


def lab_events(path: Path, left_out: dict[str, int]) -> Iterator[Event]:
    """Give the events of the log that a file was made of, in the order they were written.

    Parameters
    ----------
    path
        A file that :mod:`~koopman_lab.data.formats.mcap_file` wrote.
    left_out
        Receives how many messages by topic were changed since so that they are none any more.

    Raises
    ------
    LogError
        If the file cannot be read as MCAP.
    """
    with _reading(path) as reader:
        number = 0
        for schema, channel, message in reader.iter_messages(log_time_order=False):
            row = None if schema is None else _lab_channel(channel.topic, schema.name)
            if row is None:
                continue
            data = _encoded(row, message.data)
            if data is None:
                left_out[channel.topic] = left_out.get(channel.topic, 0) + 1
                continue
            yield Event(number, message.log_time // NS_PER_US, channel.topic, data)
            number += 1


def mcap_messages(path: Path) -> Iterator[RecordedMessage]:
    """Give the messages of a file that may hold poses or commands, the others undecoded.

    Raises
    ------
    LogError
        If the file cannot be read as MCAP, or such a message not be decoded.
    """
    wanted = {*POSES, *VELOCITIES, *ACCELERATIONS}
    factories = (ProtobufDecoders(), Ros2Decoders())
    with _reading(path) as reader:
        for schema, channel, message in reader.iter_messages():
            name = "" if schema is None else schema.name
            decode = None
            if name in wanted:
                decoders = (f.decoder_for(channel.message_encoding, schema) for f in factories)
                decode = next((d for d in decoders if d is not None), None)
            yield RecordedMessage(
                channel.topic,
                name if decode is not None else f"{name} in {channel.message_encoding}",
                None if decode is None else decode(message.data),
                message.log_time // NS_PER_US,
            )


@contextlib.contextmanager
def _reading(path: Path) -> Iterator[Any]:
    """Open a file of anybody's; whatever a damaged one brings about is one expected mistake."""
    try:
        file = open_file(path)
    except FileNotFoundError:
        raise LogError(f"{path}: no such file; give an MCAP file, or the folder of a bag") from None
    except OSError as error:
        raise LogError(f"{path}: cannot be read: {error.strerror}") from None
    with file:
        try:
            yield make_reader(file)
        except (LogError, GeneratorExit):
            raise
        except Exception as error:
            raise LogError(
                f"{path}: cannot be read as MCAP ({type(error).__name__}: {error}); see with its "
                "own tools whether it is whole: mcap doctor"
            ) from None


def _lab_channel(topic: str, schema_name: str) -> Channel[Any] | None:
    try:
        channel = split_name(topic)[1]
    except BusError:
        return None
    return channel if channel.type.__name__ == schema_name else None


def _encoded(channel: Channel[Any], text: bytes) -> bytes | None:
    """Return a message as LCM has it, from its JSON; None if it is none."""
    message = channel.type()
    table = zip(message.__slots__, message.__typenames__, message.__dimensions__, strict=True)
    with contextlib.suppress(Exception):  # whatever generated code says of what is no message
        values = json.loads(text)
        for name, kind, shape in table:
            value = values[name]
            if kind in _NOT_FINITE_ALLOWED:
                value = _with_nan(value)
            setattr(message, name, value if shape or kind != "boolean" else bool(value))
        data: bytes = message.encode()
        return data
    return None


def _with_nan(value: Any) -> Any:
    """Return numbers in which NaN stands where JSON had to say null."""
    if isinstance(value, list):
        return [_with_nan(item) for item in value]
    return math.nan if value is None else value

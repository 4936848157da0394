"""Messages of layouts that were, and logs that hold them."""

import struct

from koopman_lab.eventlog.logwriter import EventLogWriter
from koopman_lab.eventlog.older_layouts import OLDER_LAYOUTS
from koopman_lab.replay.rotated_log import read_rotated_log

LETTERS = {"int8_t": "b", "int32_t": "i", "int64_t": "q", "double": "d", "boolean": "?"}
UNKNOWN = b"\x5a" * 8
"""A fingerprint of no type that ever was."""


def encode(layout, numbers):
    """Return a message of an older layout."""
    data = layout.fingerprint
    for name, kind, length in layout.fields:
        one = (numbers[name],) if length is None else numbers[name]
        data += struct.pack(f">{len(one)}{LETTERS[kind]}", *one)
    return data


def older(message):
    """Return a message of SAMPLER_STATE or REFERENCE_STATE as it was encoded with two inputs."""
    # Of several layouts of a type the oldest comes first.
    layout = next(of for of in OLDER_LAYOUTS if of.message_type is type(message))
    two = {"u1": message.u[0], "u2": message.u[1]}
    names = [name for name, *_ in layout.fields]
    return encode(layout, {n: two[n] if n in two else getattr(message, n) for n in names})


def rewritten(source, path, change):
    """Write a log with each event changed, or left out where ``change`` says None."""
    with EventLogWriter(path) as log:
        for event in read_rotated_log(source):
            data = change(event)
            if data is not None:
                log.write(event.channel, data, event.timestamp_us)
    return path

"""From the bytes of messages to NumPy structured arrays.

Messages used for training have a fixed size, so that a whole channel is decoded at once.
"""

from __future__ import annotations

import struct
from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from koopman_lab.bus.header import smallest_size
from koopman_lab.eventlog.message_blocks import Messages

StructuredArray = NDArray[np.void]

_WIRE_TYPES = {
    "int8_t": "i1",
    "int16_t": ">i2",
    "int32_t": ">i4",
    "int64_t": ">i8",
    "byte": "u1",
    "boolean": "i1",
    "float": ">f4",
    "double": ">f8",
}
_FINGERPRINT = "fingerprint"


def wire_dtype(message_type: Any) -> np.dtype[np.void] | None:
    """Return the layout of a generated LCM type on the wire, the fingerprint first.

    None if the type has no fixed size or holds other types: only generated code decodes it.
    """
    fields: list[tuple[str, str, tuple[int, ...]]] = [(_FINGERPRINT, ">u8", ())]
    for name, wire, shape in _fields(message_type):
        if wire not in _WIRE_TYPES or not all(isinstance(length, int) for length in shape):
            return None
        fields.append((name, _WIRE_TYPES[wire], tuple(int(length) for length in shape)))
    return np.dtype(fields)


def native_dtype(message_type: Any) -> np.dtype[np.void]:
    """Return the fields of a fixed-size LCM type in the byte order of this machine.

    Raises
    ------
    TypeError
        If the type has no fixed size.
    """
    wire = wire_dtype(message_type)
    if wire is None:
        raise TypeError(
            f"{message_type.__name__} has no fixed size; decode its messages one by one"
        )
    booleans = {name for name, kind, _ in _fields(message_type) if kind == "boolean"}
    return np.dtype(
        [
            (name, np.dtype(bool) if name in booleans else base.newbyteorder("="), shape)
            for name, base, shape in (
                (name, *(wire[name].subdtype or (wire[name], ())))
                for name in wire.names or ()
                if name != _FINGERPRINT
            )
        ]
    )


def decode_all(message_type: Any, messages: Messages) -> tuple[StructuredArray, NDArray[np.intp]]:
    """Decode the messages of a fixed-size type.

    Parameters
    ----------
    message_type
        The generated LCM type.
    messages
        Encoded messages.

    Returns
    -------
    The decoded messages (N,), one field each as the type names them, and the indices of those
    that are none of this type by their fingerprint, or are too short, and were left out.

    Raises
    ------
    TypeError
        If the type has no fixed size.
    """
    native = native_dtype(message_type)
    wire = wire_dtype(message_type)
    assert wire is not None  # by native_dtype
    # What follows a message, such as the tag of a key, no decoder reads.
    good = messages.sizes >= wire.itemsize
    raw = messages.heads(good, wire)
    known = raw[_FINGERPRINT] == int.from_bytes(message_type._get_packed_fingerprint(), "big")
    good[good] = known
    raw = raw if known.all() else raw[known]
    decoded = np.empty(len(raw), native)
    for name in native.names or ():
        decoded[name] = raw[name]
    return decoded, np.flatnonzero(~good)


def decode_each(message_type: Any, messages: Iterable[bytes]) -> tuple[list[Any], NDArray[np.intp]]:
    """Decode messages of any type with the generated code; returns as :func:`decode_all`."""
    smallest = smallest_size(message_type)
    decoded = [_decode_one(message_type, data, smallest) for data in messages]
    good = [message for message in decoded if message is not None]
    return good, np.flatnonzero([message is None for message in decoded])


def _decode_one(message_type: Any, data: bytes, smallest: int) -> Any | None:
    if len(data) < smallest:  # a string without its end is none, though lcm-gen's code reads it
        return None
    try:
        return message_type.decode(data)
    except (ValueError, struct.error):  # the wrong fingerprint, or too few bytes
        return None


def _fields(message_type: Any) -> list[tuple[str, str, list[Any]]]:
    table = zip(
        message_type.__slots__,
        message_type.__typenames__,
        message_type.__dimensions__,
        strict=True,
    )
    return [(name, kind, shape or []) for name, kind, shape in table]

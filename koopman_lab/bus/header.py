"""The time and the number with which every LCM message begins, read without decoding the rest."""

from __future__ import annotations

import struct
from collections.abc import Callable
from functools import cache
from typing import Any

_HEADER = struct.Struct(">8xqq")
"""Fingerprint, then utime and sequence: the first two fields of every type of this project."""

_STAMP = struct.Struct(">8sQ")
"""The same without the sequence."""

_FINGERPRINT_BYTES = 8

HeaderReader = Callable[[bytes], tuple[int, int] | None]
"""Returns ``(utime, sequence)`` of an encoded message; None for bytes that are none."""


def _header_reader(message_type: Any) -> HeaderReader:
    fingerprint: bytes = message_type._get_packed_fingerprint()
    smallest, unpack = smallest_size(message_type), _HEADER.unpack_from

    def read_in_place(data: bytes) -> tuple[int, int] | None:
        if data[:_FINGERPRINT_BYTES] != fingerprint or len(data) < smallest:
            return None
        return unpack(data)

    def read_by_decoding(data: bytes) -> tuple[int, int] | None:
        if len(data) < smallest:
            return None
        try:
            message = message_type.decode(data)
        except (ValueError, struct.error):
            return None
        return message.utime, message.sequence

    return read_in_place if _has_fixed_size(message_type) else read_by_decoding


header_reader: Callable[[Any], HeaderReader] = cache(_header_reader)
"""Returns what reads the header of a generated LCM type's messages.

Anybody may send anything on a channel: neither time nor number is believed before the type is. A
type of fixed size takes a comparison; the few others must be decoded, as only that tells whether
they are whole.
"""


def smallest_size(message_type: Any) -> int:
    """Return how many bytes a message of a generated LCM type has at least."""
    return len(message_type().encode())


def restamp(data: bytes, utime: int) -> bytes:
    """Return an encoded message with another ``utime``; it wraps as int64 does."""
    return _STAMP.pack(data, utime % 2**64) + data[_STAMP.size :]


def _has_fixed_size(message_type: Any) -> bool:
    lengths = [n for shape in message_type.__dimensions__ for n in shape or ()]
    return "string" not in message_type.__typenames__ and all(isinstance(n, int) for n in lengths)

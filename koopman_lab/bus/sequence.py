"""Loss seen by sequence numbers."""

from __future__ import annotations

import struct
from collections.abc import Callable

_HEADER = struct.Struct(">8xqq")
"""Fingerprint, then utime and sequence: the first two fields of every type of this project."""

_STAMP = struct.Struct(">8sQ")
"""The same without the sequence."""

SMALLEST_MESSAGE = _HEADER.size

LATEST = 64
"""A message that so many have overtaken counts as lost."""


peek: Callable[[bytes], tuple[int, int]] = _HEADER.unpack_from
"""Returns ``(utime, sequence)`` of an encoded message without decoding the rest; raises
struct.error if the bytes are fewer than the two fields."""


def restamp(data: bytes, utime: int) -> bytes:
    """Return an encoded message with another ``utime``; it wraps as int64 does."""
    return _STAMP.pack(data, utime % 2**64) + data[_STAMP.size :]


class SequenceCounter:
    """Counts missing messages of one stream.

    A message that was overtaken is missing until it comes; the newest number once more is a
    repetition; any other number lower than expected is a publisher that started again.
    """

    def __init__(self) -> None:
        self.lost = 0
        self.restarts = 0
        self._next: int | None = None
        self._missing: set[int] = set()

    def update(self, sequence: int) -> int:
        """Take the next received number; return how many were missing just before it."""
        if sequence == self._next:
            self._next = sequence + 1
            return 0
        if sequence in self._missing:
            self._missing.discard(sequence)
            self.lost -= 1
            return 0
        expected = sequence if self._next is None else self._next
        if sequence == expected - 1:
            return 0
        gap = max(0, sequence - expected)
        if gap:
            oldest = sequence - LATEST
            self._missing = {number for number in self._missing if number >= oldest}
            self._missing.update(range(max(expected, oldest), sequence))
        elif sequence < expected:
            self.restarts += 1
            self._missing.clear()
        self._next = sequence + 1
        self.lost += gap
        return gap

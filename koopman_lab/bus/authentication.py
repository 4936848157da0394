"""Who may speak: a tag behind a message that only holders of the lab's key can make.

The tag travels as a trailer behind the encoded message, so that no type changes: generated decoders
read as far as their message goes, and logs store the bytes as they came. The trailer is::

    magic (4) | sender (8, random) | counter (8, big-endian) | tag (16)

The tag is HMAC-SHA256 (RFC 2104), cut to 128 bits, over the channel's name, which holds that of the
robot, the sender, the counter, and the message. Each sender has a number drawn at its start, so
that counters begin at 0 again without any clock: one that was set back makes no difference, and two
that speak on one channel do not disturb each other.
"""

from __future__ import annotations

import hmac
import os
import struct
from collections import OrderedDict
from enum import Enum

SENDER_BYTES = 8
MAGIC = b"KLK1"
TAG_BYTES = 16
_TRAILER = struct.Struct(f">4s{SENDER_BYTES}sQ{TAG_BYTES}s")
_SENDER_AND_COUNTER = struct.Struct(f">{SENDER_BYTES}sQ")
TRAILER_BYTES = _TRAILER.size

WINDOW = 64
"""So far a message may be overtaken by others of its sender; later it counts as sent again."""
MOST_SENDERS = 256
"""Of one channel; every one of them has the key. The one heard of longest ago is forgotten: what it
said could be sent again, as to a receiver that was started since. Then its time stamp judges it."""


class Verdict(Enum):
    """What a trailer says of a message."""

    VALID = "carries the key's tag, for the first time"
    UNSIGNED = "has no trailer"
    FORGED = "has a tag of another key, channel or message"
    REPEATED = "was sent before"


class Signer:
    """Puts a trailer behind messages.

    Parameters
    ----------
    key
        Of the lab.
    sender
        Number of the sender; drawn at random where none is given. Nobody may use one twice.
    """

    def __init__(self, key: bytes, sender: bytes | None = None) -> None:
        self._key = key
        self._sender = os.urandom(SENDER_BYTES) if sender is None else sender
        self._channels: dict[str, tuple[hmac.HMAC, int]] = {}
        """Maps a channel's name to the tag begun with it, and the next counter."""

    def sign(self, name: str, data: bytes) -> bytes:
        """Return an encoded message for the channel ``name`` of the bus, with its trailer."""
        begun, counter = self._channels.get(name) or (_begun(self._key, name), 0)
        self._channels[name] = begun, counter + 1
        tag = _tag(begun, self._sender, counter, data)
        return data + _TRAILER.pack(MAGIC, self._sender, counter, tag)


class Verifier:
    """Judges the messages of one channel.

    Parameters
    ----------
    key
        Of the lab.
    name
        Of the channel on the bus.

    Attributes
    ----------
    sender
        Number of the sender of the newest valid message; empty before the first.
    """

    def __init__(self, key: bytes, name: str) -> None:
        self.sender = b""
        self._begun = _begun(key, name)
        self._senders: OrderedDict[bytes, _Counters] = OrderedDict()

    def judge(self, data: bytes) -> Verdict:
        """Return what the trailer of a message says; one that is valid is remembered."""
        if len(data) < TRAILER_BYTES:
            return Verdict.UNSIGNED
        magic, sender, counter, tag = _TRAILER.unpack_from(data, len(data) - TRAILER_BYTES)
        if magic != MAGIC:
            return Verdict.UNSIGNED
        expected = _tag(self._begun, sender, counter, data[:-TRAILER_BYTES])
        if not hmac.compare_digest(tag, expected):
            return Verdict.FORGED
        senders = self._senders
        counters = senders.get(sender)
        if counters is None:
            if len(senders) == MOST_SENDERS:
                senders.popitem(last=False)
            counters = senders[sender] = _Counters()
        senders.move_to_end(sender)
        if not counters.take(counter):
            return Verdict.REPEATED
        self.sender = sender
        return Verdict.VALID


class _Counters:
    """Which counters of one sender were heard; those far behind the newest count as heard.

    As the anti-replay window of IPsec (RFC 4303, section 3.4.3).
    """

    def __init__(self) -> None:
        self._newest = -1
        self._heard = 0
        """Bit k is set where the counter k before the newest one was heard."""

    def take(self, counter: int) -> bool:
        """Take a counter; return whether it comes for the first time."""
        ahead = counter - self._newest
        if ahead > 0:
            self._heard = ((self._heard << min(ahead, WINDOW)) | 1) & ((1 << WINDOW) - 1)
            self._newest = counter
            return True
        bit = 1 << -ahead
        if -ahead >= WINDOW or self._heard & bit:
            return False
        self._heard |= bit
        return True


def _begun(key: bytes, name: str) -> hmac.HMAC:
    """Return a tag that holds the channel's name; its length goes before it, so that it ends."""
    encoded = name.encode()
    return hmac.new(key, len(encoded).to_bytes(2, "big") + encoded, "sha256")


def _tag(begun: hmac.HMAC, sender: bytes, counter: int, data: bytes) -> bytes:
    tag = begun.copy()
    tag.update(_SENDER_AND_COUNTER.pack(sender, counter) + data)
    return tag.digest()[:TAG_BYTES]

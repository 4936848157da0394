"""Datagrams that are nearly LCM's: those of a lab, with a mistake in each."""

from __future__ import annotations

import random
import struct
from collections.abc import Callable, Iterator

from koopman_lab.bus.channels import all_channels
from koopman_lab.bus.datagram_filter import (
    FRAGMENT,
    LONGEST_NAME,
    SHORT,
    SHORT_HEADER,
)

LARGEST_NUMBER = 2**32 - 1
Mutation = Callable[[bytes, random.Random], bytes]


def short_message(name: bytes, payload: bytes, number: int = 0) -> bytes:
    """Return the datagram of a message that fits into one."""
    return struct.pack(">4sI", SHORT, number) + name + b"\0" + payload


def fragment(size: int, offset: int, number: int, count: int, content: bytes) -> bytes:
    """Return one datagram of a message; the content of the first begins with name and zero byte.

    Parameters
    ----------
    size, offset
        Of the message, and where in it the content stands (bytes).
    number, count
        Of this fragment, from 0, and of all.
    content
        What follows the header.
    """
    return struct.pack(">4sIIIHH", FRAGMENT, 7, size, offset, number, count) + content


def lab_messages(robot_name: str) -> list[tuple[bytes, bytes]]:
    """Return name and payload of an empty message for each channel of a robot."""
    return [(c.name(robot_name).encode(), c.type().encode()) for c in all_channels()]


def mutated(robot_name: str, seed: int) -> Iterator[bytes]:
    """Return datagrams without end, each as a lab sends it but for one mutation."""
    draw = random.Random(seed)
    messages = lab_messages(robot_name)
    while True:
        name, payload = draw.choice(messages)
        whole = draw.choice((_as_short, _as_fragment))(name, payload, draw)
        yield draw.choice(MUTATIONS)(whole, draw)


def _as_short(name: bytes, payload: bytes, draw: random.Random) -> bytes:
    return short_message(name, payload, draw.getrandbits(32))


def _as_fragment(name: bytes, payload: bytes, draw: random.Random) -> bytes:
    count = draw.randrange(4)
    return fragment(len(payload), 0, draw.randrange(2), count, name + b"\0" + payload)


def _cut(whole: bytes, draw: random.Random) -> bytes:
    return whole[: draw.randrange(len(whole))]


def _bit_flipped(whole: bytes, draw: random.Random) -> bytes:
    place = draw.randrange(len(whole))
    return whole[:place] + bytes([whole[place] ^ 1 << draw.randrange(8)]) + whole[place + 1 :]


def _noise_behind_the_magic(whole: bytes, draw: random.Random) -> bytes:
    return whole[:4] + draw.randbytes(draw.randrange(64))


def _name_without_end(whole: bytes, draw: random.Random) -> bytes:
    length = draw.randrange(3 * LONGEST_NAME)
    return whole[:SHORT_HEADER] + b"R" * length


def _field_of_the_header(whole: bytes, draw: random.Random) -> bytes:
    place = draw.choice((4, 8, 12, 16, 18))
    extreme = draw.choice((0, 1, 2**28, 2**31, LARGEST_NUMBER, draw.getrandbits(32)))
    return whole[:place] + struct.pack(">I", extreme) + whole[place + 4 :]


def _noise_in_the_payload(whole: bytes, draw: random.Random) -> bytes:
    kept = min(len(whole), draw.randrange(len(whole)) + SHORT_HEADER)
    return whole[:kept] + draw.randbytes(len(whole) - kept)


MUTATIONS: tuple[Mutation, ...] = (
    *(_cut, _bit_flipped, _noise_behind_the_magic),
    *(_name_without_end, _field_of_the_header, _noise_in_the_payload),
)

"""Which datagrams may reach the LCM library: a program for the kernel's classic packet filter.

liblcm 1.5.3 trusts that a channel name ends within its datagram. One of eight bytes, or one whose
name has no end, makes it hand on a message of negative size, and the process dies of it
(tests/bus/liblcm_short_datagram). So the kernel sorts out what is no datagram of LCM before the
library reads it. The layouts are those of LCM's UDP multicast protocol:

- short message: ``"LC02"``, number (4 bytes), channel name, zero byte, payload;
- fragment: ``"LC03"``, number (4), size of the message (4), offset in it (4), number of the
  fragment (2), count of fragments (2); the first one goes on with name and zero byte, then payload.

A fragment needs as many bytes as its header, a place within its message, and a message of at most
:data:`LARGEST_MESSAGE_BYTES`. The first one carries its share of the message: else 27 bytes would
make every listener hold, and the logger write, a message of 256 MB.

The filter reads big-endian, like LCM; where a program loads beyond the end, the kernel drops the
datagram (https://docs.kernel.org/networking/filter.html).
"""

from __future__ import annotations

import functools
import struct
from collections.abc import Iterable
from itertools import chain
from typing import NamedTuple

SHORT, FRAGMENT = b"LC02", b"LC03"
LONGEST_NAME = 63
"""Of a channel, in bytes, without the zero byte; the library's."""
LARGEST_MESSAGE_BYTES = 1 << 20
"""In fragments. An assumption: a lab's messages have kilobytes, and need no fragments on Linux."""

UDP_HEADER = 8
"""Stands before what was sent, also where a socket's filter looks."""
SHORT_HEADER, FRAGMENT_HEADER = 8, 20
SIZE_AT, OFFSET_AT, NUMBER_AT, COUNT_AT = 8, 12, 16, 18

LOAD_LENGTH, LOAD_INDEX, LOAD_INDEX_KEPT = 0x80, 0x01, 0x61
LOAD_WORD, LOAD_HALF = 0x20, 0x28
LOAD_WORD_INDEXED, LOAD_HALF_INDEXED, LOAD_BYTE_INDEXED = 0x40, 0x48, 0x50
STORE, ADD_INDEX, SUBTRACT, MULTIPLY_INDEX, INDEX_FROM = 0x02, 0x0C, 0x14, 0x2C, 0x07
JUMP, EQUALS, GREATER, AT_LEAST = 0x05, 0x15, 0x25, 0x35
GREATER_THAN_INDEX, AT_LEAST_INDEX = 0x2D, 0x3D
RETURN = 0x06
WHOLE, NOTHING = 0xFFFFFFFF, 0


class Instruction(NamedTuple):
    """One instruction of the kernel's ``struct sock_filter``.

    The machine has an accumulator, an index register and sixteen words of memory. Names above say
    what an instruction does to the accumulator, if they say nothing else.

    Attributes
    ----------
    code
        What to do.
    if_true, if_false
        How many instructions a comparison skips.
    operand
        A constant, an offset, or the place of a word of memory.
    """

    code: int
    if_true: int = 0
    if_false: int = 0
    operand: int = 0


Program = tuple[Instruction, ...]
ACCEPT, DROP = Instruction(RETURN, operand=WHOLE), Instruction(RETURN, operand=NOTHING)
SHUT: Program = (DROP,)
"""Passes nothing."""
MESSAGE_SIZE, FRAGMENT_COUNT = 0, 1
"""Words of memory."""


def datagram_filter(names: Iterable[str] | None = None) -> Program:
    """Return the program that passes what liblcm can take.

    Parameters
    ----------
    names
        Pass only messages on these channels; None for any. Who listens to a few channels is not
        woken by the others, nor does the library then keep a table entry for every name it is
        sent (some 130 bytes each, for good).
    """
    if names is None:
        return (*_headers(), *_any_name())
    # Shorter ones first: comparing with a longer one may load beyond a message without payload.
    by_length = sorted(names, key=lambda name: (len(name), name))
    return (*_headers(), *chain.from_iterable(map(_name, by_length)), DROP)


def packed(program: Program) -> bytes:
    """Return the program as the kernel reads it, an array of ``struct sock_filter``."""
    return b"".join(
        struct.pack("=HBBI", code, true, false, operand) for code, true, false, operand in program
    )


def _headers() -> Program:
    """Judge what stands before the name; leave the index register where the name begins."""
    fragment = _fragment_header()
    return (
        Instruction(LOAD_WORD, operand=UDP_HEADER),
        Instruction(EQUALS, 0, 2, int.from_bytes(SHORT, "big")),
        Instruction(LOAD_INDEX, operand=UDP_HEADER + SHORT_HEADER),
        Instruction(JUMP, operand=len(fragment)),
        *fragment,
    )


def _require(comparison: int, operand: int = 0) -> Program:
    """Return a comparison, and the end of the datagram where it does not hold."""
    return (Instruction(comparison, 1, 0, operand), DROP)


def _refuse(comparison: int, operand: int = 0) -> Program:
    """Return a comparison, and the end of the datagram where it holds."""
    return (Instruction(comparison, 0, 1, operand), DROP)


def _fragment_header() -> Program:
    """Judge a fragment's header; accept all but first fragments, whose name is yet to be seen."""
    payload = (
        Instruction(LOAD_LENGTH),
        Instruction(SUBTRACT, operand=UDP_HEADER + FRAGMENT_HEADER),
    )
    first = (
        # As many fragments of this length must hold the message.
        Instruction(LOAD_INDEX_KEPT, operand=FRAGMENT_COUNT),
        *payload,
        Instruction(MULTIPLY_INDEX),
        Instruction(LOAD_INDEX_KEPT, operand=MESSAGE_SIZE),
        *_require(AT_LEAST_INDEX),
        Instruction(LOAD_WORD, operand=UDP_HEADER + OFFSET_AT),
        *_require(EQUALS, 0),
        Instruction(LOAD_INDEX, operand=UDP_HEADER + FRAGMENT_HEADER),
    )
    later = (
        # Bounded first, so that the sum cannot run over.
        Instruction(LOAD_WORD, operand=UDP_HEADER + OFFSET_AT),
        *_refuse(GREATER, LARGEST_MESSAGE_BYTES),
        Instruction(INDEX_FROM),
        *payload,
        Instruction(ADD_INDEX),
        Instruction(LOAD_INDEX_KEPT, operand=MESSAGE_SIZE),
        *_refuse(GREATER_THAN_INDEX),
        ACCEPT,
    )
    return (
        Instruction(LOAD_WORD, operand=UDP_HEADER),
        *_require(EQUALS, int.from_bytes(FRAGMENT, "big")),
        Instruction(LOAD_LENGTH),
        *_require(AT_LEAST, UDP_HEADER + FRAGMENT_HEADER),
        Instruction(LOAD_WORD, operand=UDP_HEADER + SIZE_AT),
        *_refuse(GREATER, LARGEST_MESSAGE_BYTES),
        Instruction(STORE, operand=MESSAGE_SIZE),
        Instruction(LOAD_HALF, operand=UDP_HEADER + COUNT_AT),
        Instruction(STORE, operand=FRAGMENT_COUNT),
        Instruction(LOAD_INDEX_KEPT, operand=FRAGMENT_COUNT),
        Instruction(LOAD_HALF, operand=UDP_HEADER + NUMBER_AT),
        # Also refuses a count of zero, with which the library would wait for 65536 fragments.
        *_refuse(AT_LEAST_INDEX),
        Instruction(EQUALS, len(later), 0, 0),
        *later,
        *first,
    )


def _any_name() -> Program:
    """Accept where a zero byte ends the name in time."""
    places = range(LONGEST_NAME + 1)
    scan = [
        instruction
        for place in places
        for instruction in (
            Instruction(LOAD_BYTE_INDEXED, operand=place),
            # To the acceptance behind the scan and the refusal.
            Instruction(EQUALS, 2 * (LONGEST_NAME - place) + 1, 0, 0),
        )
    ]
    return (*scan, DROP, ACCEPT)


@functools.cache
def _name(name: str) -> Program:
    """Accept where exactly this name stands; skip to what follows where it does not."""
    encoded = name.encode() + b"\0"
    parts: list[tuple[int, int, int]] = []
    place = 0
    for size, code in ((4, LOAD_WORD_INDEXED), (2, LOAD_HALF_INDEXED), (1, LOAD_BYTE_INDEXED)):
        while len(encoded) - place >= size:
            parts.append((code, place, int.from_bytes(encoded[place : place + size], "big")))
            place += size
    program: list[Instruction] = []
    for index, (code, at, value) in enumerate(parts):
        left = len(parts) - index - 1
        program += (
            Instruction(code, operand=at),
            Instruction(EQUALS, 0, 2 * left + 1, value),
        )
    return (*program, ACCEPT)

"""A machine for the kernel's classic packet filter, and what ours is to say, in plain Python."""

import struct
from collections.abc import Collection

from koopman_lab.bus.datagram_filter import LARGEST_MESSAGE_BYTES, Program

UDP_HEADER = bytes(8)
FETCH = {0x20: (4, False), 0x28: (2, False), 0x30: (1, False)}
FETCH |= {0x40: (4, True), 0x48: (2, True), 0x50: (1, True)}
"""Size of a load from the packet, and whether its place is counted from the index register."""
MASK = 0xFFFFFFFF


def accepts(program: Program, datagram: bytes) -> bool:
    """Run a program as the kernel does, on what a UDP socket was sent."""
    packet = UDP_HEADER + datagram
    accumulator = index = at = 0
    memory = [0] * 16
    while True:
        code, if_true, if_false, operand = program[at]
        at += 1
        value = index if code & 0x08 else operand
        match code:
            case 0x20 | 0x28 | 0x30 | 0x40 | 0x48 | 0x50:
                size, indexed = FETCH[code]
                place = operand + (index if indexed else 0)
                if place + size > len(packet):
                    return False
                accumulator = int.from_bytes(packet[place : place + size], "big")
            case 0x80:
                accumulator = len(packet)
            case 0x01:
                index = operand
            case 0x61:
                index = memory[operand]
            case 0x02:
                memory[operand] = accumulator
            case 0x07:
                index = accumulator
            case 0x0C:
                accumulator = accumulator + value & MASK
            case 0x14:
                accumulator = accumulator - value & MASK
            case 0x2C:
                accumulator = accumulator * value & MASK
            case 0x05:
                at += operand
            case 0x15:
                at += if_true if accumulator == value else if_false
            case 0x25 | 0x2D:
                at += if_true if accumulator > value else if_false
            case 0x35 | 0x3D:
                at += if_true if accumulator >= value else if_false
            case 0x06:
                return operand != 0
            case _:
                raise AssertionError(f"no instruction has the code {code:#x}")


def may_pass(datagram: bytes, names: Collection[str] | None = None) -> bool:
    """Return whether liblcm can take a datagram, and is to have it."""
    if datagram.startswith(b"LC02"):
        return _has_name(datagram[8:], names)
    if not datagram.startswith(b"LC03") or len(datagram) < 20:
        return False
    _, size, offset, number, count = struct.unpack(">IIIHH", datagram[4:20])
    content = datagram[20:]
    if size > LARGEST_MESSAGE_BYTES or number >= count:
        return False
    if number > 0:
        return offset + len(content) <= size
    return offset == 0 and len(content) * count >= size and _has_name(content, names)


def _has_name(content: bytes, names: Collection[str] | None) -> bool:
    name, zero, _ = content.partition(b"\0")
    if not zero or len(name) > 63:
        return False
    return names is None or name in {name.encode() for name in names}

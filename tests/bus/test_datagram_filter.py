"""The filter's program says of every datagram what a plain predicate says."""

import socket
import struct
from itertools import islice

import pytest
from datagrams.packet_filter import accepts, may_pass
from hypothesis import example, given, settings
from hypothesis import strategies as st

from koopman_lab.bus.channels import all_channels
from koopman_lab.bus.datagram_filter import LARGEST_MESSAGE_BYTES, datagram_filter, packed
from koopman_lab.bus.receiving_socket import attach
from offboard.bench.mutated_datagrams import fragment, lab_messages, mutated, short_message

NAMES = [channel.name("R1") for channel in all_channels()]
FEW = ["A", "AB", "ABCD", "ABCDE", "ABCDEFGHI"]
LISTENERS = [None, (), FEW, NAMES]
EDGES = st.sampled_from((0, 1, 2, 63, 1 << 16, LARGEST_MESSAGE_BYTES, 2**28, 2**32 - 1))
UINT32 = EDGES | st.integers(0, 2**32 - 1) | st.integers(0, 200)
UINT16 = st.integers(0, 3) | st.sampled_from((0x7FFF, 0xFFFF)) | st.integers(0, 0xFFFF)
NAME = (
    st.sampled_from([*FEW, "ABCDEF", *NAMES]).map(str.encode)
    | st.binary(max_size=70)
    | st.integers(60, 66).map(lambda length: b"A" * length)
)
CONTENT = st.tuples(NAME, st.booleans(), st.binary(max_size=40)).map(
    lambda parts: parts[0] + (b"\0" if parts[1] else b"") + parts[2]
)


@st.composite
def datagrams(draw):
    """Draw what is nearly one of LCM's, or nothing like it, cut anywhere."""
    magic = draw(st.sampled_from((b"LC02", b"LC03", b"LC03", b"LC01", b"")))
    fields = struct.pack(
        ">IIIHH", draw(UINT32), draw(UINT32), draw(UINT32), draw(UINT16), draw(UINT16)
    )
    header = fields[:4] if magic == b"LC02" else fields
    whole = magic + header + draw(CONTENT)
    return draw(st.just(whole) | st.integers(0, len(whole)).map(lambda end: whole[:end]))


@pytest.mark.parametrize("names", LISTENERS)
@settings(max_examples=1500)
@given(datagram=datagrams() | st.binary(max_size=100))
@example(datagram=b"LC02\0\0\0\0")
@example(datagram=b"LC02\0\0\0\0A\0")
@example(datagram=short_message(b"A" * 63, b""))
@example(datagram=short_message(b"A" * 64, b""))
@example(datagram=fragment(1 << 20, 0, 0, 16, b"A\0" + bytes((1 << 16) - 30)))
@example(datagram=fragment(2, 0, 0xFFFF, 0xFFFF, b""))
def test_the_program_says_what_the_predicate_says(names, datagram):
    assert accepts(datagram_filter(names), datagram) == may_pass(datagram, names)


@pytest.mark.parametrize("names", LISTENERS)
def test_it_says_so_of_mutated_messages_of_a_lab(names):
    program = datagram_filter(names)
    said = [
        (accepts(program, datagram), may_pass(datagram, names))
        for datagram in islice(mutated("R1", seed=1), 20_000)
    ]
    assert all(answer == expected for answer, expected in said)
    assert {answer for answer, _ in said} == {True, False} or not names


def test_every_message_of_a_lab_passes_and_only_to_who_listens():
    for name, payload in lab_messages("R1"):
        datagram = short_message(name, payload)
        assert accepts(datagram_filter(NAMES), datagram)
        assert accepts(datagram_filter(), datagram)
        others = [other for other in NAMES if other != name.decode()]
        assert not accepts(datagram_filter(others), datagram)


@pytest.mark.parametrize("count", [2, 3, 20])
def test_a_whole_message_in_fragments_passes(count):
    payload, name = bytes(5000), b"R1_SESSION_INFO\0"
    share = -(-(len(payload) + len(name)) // count)
    pieces = [(name + payload)[k * share : (k + 1) * share] for k in range(count)]
    for number, piece in enumerate(pieces):
        offset = max(0, number * share - len(name))
        datagram = fragment(len(payload), offset, number, count, piece)
        assert accepts(datagram_filter(NAMES), datagram)


@pytest.mark.parametrize("names", LISTENERS)
def test_the_kernel_says_so_too(names):
    """Through a real socket, told apart by a last datagram that passes every filter."""
    receiver = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    sender = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    with receiver, sender:
        receiver.bind(("127.0.0.1", 0))
        receiver.settimeout(20.0)
        sender.connect(receiver.getsockname())
        attach(receiver.fileno(), datagram_filter(names))
        last = fragment(0, 0, 1, 2, b"")
        for datagram in islice(mutated("R1", seed=2), 3000):
            sender.send(datagram)
            sender.send(last)
            came = receiver.recv(1 << 16)
            assert (came == datagram) == may_pass(datagram, names) or datagram == last
            if came != last:
                assert receiver.recv(1 << 16) == last


def test_it_is_packed_as_the_kernel_reads_it():
    program = datagram_filter(NAMES)
    assert len(packed(program)) == 8 * len(program)
    assert len(program) < 4096

"""Who sends on a bus: each stream with the socket that it comes from."""

import os
import socket
import threading

import lcm
import pytest
from hypothesis import given
from hypothesis import strategies as st
from klab import klab

from koopman_lab.bus.bus_url import parse_bus_url
from koopman_lab.errors import BusError
from offboard.commands.doctor_checks.senders import Sender, channel_of, senders_by_channel
from offboard.commands.doctor_checks.socket_owners import SocketOwners

names = st.text(st.characters(codec="utf-8", exclude_characters="\0"), max_size=60).filter(
    lambda name: len(name.encode()) <= 63
)


@given(names, st.binary(max_size=50))
def test_the_name_of_a_channel_stands_in_the_first_datagram_of_a_message(name, data):
    said = name.encode() + b"\0" + data
    assert channel_of(b"LC02" + bytes(4) + said) == name
    first, later = bytes(14) + bytes(2), bytes(12) + b"\0\1" + bytes(2)
    assert channel_of(b"LC03" + first + said) == name
    assert channel_of(b"LC03" + later + said) is None


@given(st.binary(max_size=100))
def test_whatever_arrives_has_a_name_or_none(datagram):
    for head in (b"", b"LC02", b"LC03"):
        assert isinstance(channel_of(head + datagram), str | None)


class Speaker:
    """Says something on channels again and again, from a socket of its own."""

    def __init__(self, url, *names):
        self._bus, self._names, self._end = lcm.LCM(url), names, threading.Event()
        self._thread = threading.Thread(target=self._speak)

    def __enter__(self):
        self._thread.start()
        return self

    def __exit__(self, *raised):
        self._end.set()
        self._thread.join()

    def _speak(self):
        while not self._end.wait(0.02):
            for name in self._names:
                self._bus.publish(name, b"x")


def test_streams_of_two_programs_are_told_apart(bus_url):
    with Speaker(bus_url, "A", "SHARED"), Speaker(bus_url, "SHARED", "LEG[/0]\t"):
        heard = senders_by_channel(parse_bus_url(bus_url), 0.5)
    assert heard.keys() == {"A", "SHARED", "LEG[/0]\t"}
    (first,), (second,) = heard["A"], heard["LEG[/0]\t"]
    assert first != second
    assert heard["SHARED"].keys() == {first, second}
    assert min(min(counts.values()) for counts in heard.values()) > 2


def test_a_group_that_cannot_be_joined_is_said():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as holder:
        holder.bind(("0.0.0.0", 0))
        url = f"udpm://239.255.76.67:{holder.getsockname()[1]}"
        with pytest.raises(BusError, match="cannot be joined"):
            senders_by_channel(parse_bus_url(url), 0.1)


def test_a_socket_of_this_machine_has_a_process_and_that_of_another_none():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as udp:
        udp.bind(("127.0.0.1", 0))
        port = udp.getsockname()[1]
        said = SocketOwners().text(Sender("127.0.0.1", port))
        assert said.startswith(f", process {os.getpid()}: ")
        # An address of documentation, RFC 5737: no machine has it.
        assert SocketOwners().text(Sender("192.0.2.1", port)) == ""


def test_the_doctor_names_the_sender_of_each_stream_and_looks_at_the_machine(bus_url):
    with Speaker(bus_url, "SENSOR[left]", "\x1b[2J"):
        done = klab("doctor", "--url", bus_url)
    assert done.returncode == 0, done.stdout + done.stderr
    said = " ".join(done.stdout.split())
    assert f"process {os.getpid()}: " in said
    assert "stream SENSOR[left]: ok (" in said
    assert r"stream \x1b[2J: ok (" in said
    for what in ("timing", "disk", "clock", "extra desk"):
        assert f"{what}: " in said
    assert "100 ticks of 10 ms" in said

"""Who sends on a bus: the address that each datagram comes from.

LCM hands on what was said and not who said it. So the bus is joined once more, by a socket of our
own, which sees the datagrams themselves; their layout is that of
:mod:`koopman_lab.bus.datagram_filter`.
"""

from __future__ import annotations

import select
import socket
import time
from collections import Counter
from typing import NamedTuple

from koopman_lab.bus.bus_url import BusUrl
from koopman_lab.bus.datagram_filter import (
    FRAGMENT,
    FRAGMENT_HEADER,
    LONGEST_NAME,
    NUMBER_AT,
    SHORT,
    SHORT_HEADER,
)
from koopman_lab.errors import BusError

LARGEST_DATAGRAM = 65_536


class Sender(NamedTuple):
    """The socket that datagrams come from."""

    host: str
    port: int

    def __str__(self) -> str:
        return f"{self.host}:{self.port}"


def channel_of(datagram: bytes) -> str | None:
    """Return the channel whose message a datagram is or begins.

    None for one that goes on with a message, and for one that is none of LCM's.
    """
    if datagram.startswith(SHORT):
        begin = SHORT_HEADER
    elif datagram.startswith(FRAGMENT) and not any(datagram[NUMBER_AT : NUMBER_AT + 2]):
        begin = FRAGMENT_HEADER
    else:
        return None
    end = datagram.find(b"\0", begin, begin + LONGEST_NAME + 1)
    if end < 0:
        return None
    # As LCM's Python bindings read names.
    return datagram[begin:end].decode(errors="replace")


def senders_by_channel(bus: BusUrl, seconds: float) -> dict[str, Counter[Sender]]:
    """Listen for a while; return how many messages of each channel came from whom.

    Parameters
    ----------
    bus
        A bus of UDP multicast; of others nothing is heard.
    seconds
        How long.

    Raises
    ------
    BusError
        If the group cannot be joined.
    """
    heard: dict[str, Counter[Sender]] = {}
    if bus.scheme != "udpm":
        return heard
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as udp:
        try:
            udp.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            udp.bind((bus.host, bus.port))
            group = socket.inet_aton(bus.host) + socket.inet_aton("0.0.0.0")
            udp.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, group)
        except OSError as error:
            raise BusError(f"{bus.host}:{bus.port}: cannot be joined ({error.strerror})") from None
        end_s = time.monotonic() + seconds
        while (left_s := end_s - time.monotonic()) > 0.0:
            if not select.select([udp], (), (), left_s)[0]:
                break
            datagram, (host, port) = udp.recvfrom(LARGEST_DATAGRAM)
            channel = channel_of(datagram)
            if channel is not None:
                heard.setdefault(channel, Counter())[Sender(host, port)] += 1
    return heard

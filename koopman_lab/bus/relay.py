"""Sends what is said on one bus on to another one, and nothing back."""

from __future__ import annotations

import ipaddress
import re

import lcm

from koopman_lab.errors import BusError

DEFAULT_GROUP, DEFAULT_PORT = "239.255.76.67", 7667
"""What LCM takes where a URL leaves it out."""


class ReadOnlyRelay:
    """Sends every message of ``source`` on to ``guests``, byte for byte.

    Nothing is ever subscribed to on the guests' bus, so that no word of theirs comes back.

    Parameters
    ----------
    source, guests
        Opened; see :func:`require_apart`.
    """

    def __init__(self, source: lcm.LCM, guests: lcm.LCM) -> None:
        self.messages = 0
        """Sent on."""
        self.refused = 0
        """That LCM would not send on."""
        self._guests = guests
        source.subscribe(".*", self._send_on).set_queue_capacity(0)

    def _send_on(self, name: str, data: bytes) -> None:
        try:
            self._guests.publish(name, data)
            self.messages += 1
        except OSError:  # a buffer of the network is full, or there is no way to the guests now
            self.refused += 1


def require_apart(source: str, guests: str) -> None:
    """Refuse URLs of buses that hear each other.

    On one machine a port hears all groups that anybody there has joined: buses on one port are one,
    whatever their groups.

    Raises
    ------
    BusError
        If they are on one port, or one of them is no bus of a network.
    """
    (_, port), (_, guests_port) = _group_and_port(source), _group_and_port(guests)
    if port == guests_port:
        raise BusError(
            f"--to {guests}: on the port of the lab's bus, {port}, a machine hears both, and what "
            f"guests say would come back; take another port, for example {port + 1}"
        )


def _group_and_port(url: str) -> tuple[str, int]:
    parts = re.fullmatch(r"udpm://([0-9.]*)(?::(\d+))?/?(?:\?.*)?", url)
    group, port = (parts[1] or DEFAULT_GROUP, int(parts[2] or DEFAULT_PORT)) if parts else ("", 0)
    try:
        is_multicast = ipaddress.IPv4Address(group).is_multicast
    except ValueError:
        is_multicast = False
    if not is_multicast or not 0 < port < 65536:
        raise BusError(
            f"{url}: no bus that can be relayed; expected udpm://GROUP:PORT?ttl=N with a group "
            "from 224.0.0.0 to 239.255.255.255"
        )
    return group, port

"""LCM's bus: how it is opened, and how what has arrived is taken."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import lcm

from koopman_lab.bus.filtered_bus import FilteredBus, without_stderr
from koopman_lab.errors import BusError

if TYPE_CHECKING:
    from koopman_lab.config.schema import LabConfig


def bus_url(config: LabConfig) -> str:
    """Return the LCM URL with the receive buffer asked for; without it bursts are lost."""
    url = config.bus.url
    if not url.startswith("udpm://") or "recv_buf_size" in url:
        return url
    join = "&" if "?" in url else "?"
    return f"{url}{join}recv_buf_size={config.bus.receive_buffer_bytes}"


def open_lcm(config: LabConfig) -> FilteredBus:
    """Open the bus; it begins to listen, behind its filter, when that is first needed.

    Raises
    ------
    BusError
        If LCM cannot be opened; the message says how to make a multicast route.
    """
    url = bus_url(config)
    try:
        with without_stderr():
            return FilteredBus(url)
    except (RuntimeError, ValueError, OSError):
        raise BusError(
            f"bus.url {config.bus.url}: LCM cannot open it. Most often there is no route for "
            f"multicast; this makes one: {route_remedy(config.bus.url)}. "
            "`klab doctor` looks closer."
        ) from None


def route_remedy(url: str) -> str:
    """Return how to make the route that a URL needs: within one machine, or out of it."""
    ttl = re.search(r"[?&]ttl=(\d+)", url)
    if ttl is not None and int(ttl[1]) > 0:
        return (
            "sudo ip route add 224.0.0.0/4 dev eth0 (with the interface to the other machines in "
            "place of eth0)"
        )
    return "sudo ip link set lo multicast on && sudo ip route add 224.0.0.0/4 dev lo"


MOST_AT_ONCE = 20_000
"""Messages, more than a lab says in 20 s. Under a flood there is always one more."""


def drain(bus: lcm.LCM) -> None:
    """Handle what has arrived, without waiting.

    Where more is left than :data:`MOST_AT_ONCE`, it waits for the next time, so that who drains has
    its turn however much is sent.
    """
    for _ in range(MOST_AT_ONCE):
        if bus.handle_timeout(0) <= 0:
            return

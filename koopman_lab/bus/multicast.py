"""LCM's bus: how it is opened, and how what has arrived is taken."""

from __future__ import annotations

import contextlib
import os
import re
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING

import lcm

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


def open_lcm(config: LabConfig) -> lcm.LCM:
    """Open the bus.

    Raises
    ------
    BusError
        If LCM cannot be opened; the message says how to make a multicast route.
    """
    url = bus_url(config)
    try:
        with _without_stderr():
            return lcm.LCM(url)
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


@contextlib.contextmanager
def _without_stderr() -> Iterator[None]:
    """Keep LCM's C library from writing a page of its own to standard error."""
    saved, devnull = os.dup(2), os.open(os.devnull, os.O_WRONLY)
    os.dup2(devnull, 2)
    try:
        yield
    finally:
        os.dup2(saved, 2)
        os.close(saved)
        os.close(devnull)


def subscribe(bus: lcm.LCM, name: str, handler: Callable[[str, bytes], None]) -> None:
    """Subscribe to exactly one channel with an unlimited queue.

    LCM takes a regular expression, and by default keeps only the oldest 30 messages.
    """
    bus.subscribe(f"^{re.escape(name)}$", handler).set_queue_capacity(0)


def drain(bus: lcm.LCM) -> None:
    """Handle everything that has arrived, without waiting."""
    while bus.handle_timeout(0) > 0:
        pass

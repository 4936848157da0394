"""LCM's bus: how it is opened, and how what has arrived is taken."""

from __future__ import annotations

import contextlib
import os
import re
from collections.abc import Callable, Iterator

import lcm

from koopman_lab.config.schema import LabConfig
from koopman_lab.errors import BusError


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
        with _quiet():
            return lcm.LCM(url)
    except (RuntimeError, ValueError, OSError):
        raise BusError(
            f"bus.url {config.bus.url}: LCM cannot open it. Most often there is no route for "
            "multicast; on one machine this makes one: sudo ip link set lo multicast on && "
            "sudo ip route add 224.0.0.0/4 dev lo. `klab doctor` looks closer."
        ) from None


@contextlib.contextmanager
def _quiet() -> Iterator[None]:
    """Keep LCM's C library from writing a page of its own to standard error."""
    saved, nowhere = os.dup(2), os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 2)
    try:
        yield
    finally:
        os.dup2(saved, 2)
        os.close(saved)
        os.close(nowhere)


def subscribe(bus: lcm.LCM, name: str, handler: Callable[[str, bytes], None]) -> None:
    """Subscribe to exactly one channel with an unlimited queue.

    LCM takes a regular expression, and by default keeps only the oldest 30 messages.
    """
    bus.subscribe(f"^{re.escape(name)}$", handler).set_queue_capacity(0)


def drain(bus: lcm.LCM) -> None:
    """Handle everything that has arrived, without waiting."""
    while bus.handle_timeout(0) > 0:
        pass

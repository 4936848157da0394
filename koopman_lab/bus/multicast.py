"""LCM's bus: how it is opened, and how what has arrived is taken."""

from __future__ import annotations

from typing import TYPE_CHECKING

import lcm

from koopman_lab.bus.bus_url import parse_bus_url, route_remedy
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
    BusUrlError
        If the URL is none of a bus that a lab can speak on.
    BusError
        If LCM cannot be opened; the message says how to make a multicast route, or who must answer.
    """
    address, url = parse_bus_url(config.bus.url), bus_url(config)
    try:
        with without_stderr():
            return FilteredBus(url)
    except (RuntimeError, ValueError, OSError):
        if address.scheme == "tcpq":
            raise BusError(
                f"bus.url {config.bus.url}: no server answers; start `lcm-tcpq-server` on "
                f"{address.host}, or name another with --url"
            ) from None
        raise BusError(
            f"bus.url {config.bus.url}: LCM cannot open it. Most often there is no route for "
            f"multicast; this makes one: {route_remedy(config.bus.url)}. "
            "`klab doctor` looks closer."
        ) from None


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

"""URLs of LCM buses: what one says, or what is wrong with it and what to write instead.

LCM takes a URL that it does not understand for one without what it did not understand: it binds to
port 0 where none stands there, and a ``ttl`` that is no number is 0. So a URL is read here first.
"""

from __future__ import annotations

from typing import NamedTuple

from koopman_lab.errors import BusUrlError

EXAMPLE = "udpm://239.255.76.67:7667?ttl=0"
"""LCM's default, which stays on one machine."""
MULTICAST = range(224, 240)
"""First number of a group's address."""
LARGEST_PORT, LARGEST_TTL = 65535, 255
PARAMETERS = {
    "udpm": ("ttl", "recv_buf_size", "transmit_only"),
    "mpudpm": ("ttl", "recv_buf_size", "nports"),
    "tcpq": (),
}
"""By scheme, what may stand behind the question mark."""
NO_BUS = {
    "memq": "stays within one process, so that no other program hears it",
    "file": "is a log and no bus; `klab replay FILE` sends a log",
}
"""Schemes of LCM that no lab can speak on, and why."""


class BusUrl(NamedTuple):
    """What a URL says: where messages are sent, and how many routers pass them on."""

    scheme: str
    host: str
    """Address of the multicast group, or of the server of ``tcpq``."""
    port: int
    ttl: int


def parse_bus_url(url: str) -> BusUrl:
    """Return what the URL of a bus says.

    Raises
    ------
    BusUrlError
        If no lab can speak there; the message says what is wrong and what to write instead.
    """
    scheme, separator, rest = url.partition("://")
    address, _, query = rest.partition("?")
    if not separator:
        raise _error(url, f"is no URL; expected udpm://GROUP:PORT?ttl=N, for example {EXAMPLE}")
    if scheme in NO_BUS:
        raise _error(url, f"{scheme}:// {NO_BUS[scheme]}; expected for example {EXAMPLE}")
    if scheme not in PARAMETERS:
        raise _error(url, f"LCM has no {scheme}://; expected udpm://, for example {EXAMPLE}")
    parameters = _parameters(url, scheme, query)
    ttl = _number(url, "ttl", parameters.get("ttl", "0"), 0, LARGEST_TTL)
    for name in ("recv_buf_size", "nports"):
        if name in parameters:
            _number(url, name, parameters[name], 1, 2**31 - 1)
    host, colon, port_text = address.rstrip("/").partition(":")
    if not host and not colon and scheme != "tcpq":
        return BusUrl(scheme, "239.255.76.67", 7667, ttl)
    if not colon:
        raise _error(url, f"the port is missing; expected {scheme}://{host or 'GROUP'}:7667")
    port = _number(url, "the port", port_text, 1, LARGEST_PORT)
    if scheme != "tcpq":
        _require_group(url, host)
    elif not host:
        raise _error(url, "the server is missing; expected tcpq://SERVER:7700")
    return BusUrl(scheme, host, port, ttl)


def route_remedy(url: str) -> str:
    """Return how to make the route that a URL needs: within one machine, or out of it.

    Raises
    ------
    BusUrlError
        As :func:`parse_bus_url`.
    """
    if parse_bus_url(url).ttl > 0:
        return (
            "sudo ip route add 224.0.0.0/4 dev eth0 (with the interface to the other machines in "
            "place of eth0)"
        )
    return "sudo ip link set lo multicast on && sudo ip route add 224.0.0.0/4 dev lo"


def _require_group(url: str, host: str) -> None:
    numbers = [int(part) for part in host.split(".") if part.isascii() and part.isdigit()]
    if len(numbers) != 4 or host.count(".") != 3 or max(numbers) > 255:
        raise _error(
            url,
            f"{host!r} is no address of a multicast group; expected one from 224.0.0.0 to "
            f"239.255.255.255, for example {EXAMPLE}",
        )
    if numbers[0] not in MULTICAST:
        raise _error(
            url,
            f"{host} is the address of one machine; expected a group, to which all speak, from "
            f"224.0.0.0 to 239.255.255.255, for example {EXAMPLE}. To other machines: ttl=1",
        )


def _parameters(url: str, scheme: str, query: str) -> dict[str, str]:
    known = PARAMETERS[scheme]
    parameters: dict[str, str] = {}
    for part in filter(None, query.split("&")):
        name, _, value = part.partition("=")
        if name not in known:
            raise _error(
                url,
                f"LCM knows no {name!r} there; known behind the question mark of {scheme}://: "
                f"{', '.join(known) or 'nothing'}",
            )
        parameters[name] = value
    return parameters


def _number(url: str, what: str, text: str, least: int, most: int) -> int:
    if not (text.isascii() and text.isdigit()) or not least <= int(text[:20]) <= most:
        raise _error(url, f"{what} is {text!r}; expected a whole number from {least} to {most}")
    return int(text)


def _error(url: str, what: str) -> BusUrlError:
    return BusUrlError(f"bus URL {url}: {what}")

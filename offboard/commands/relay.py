"""`klab relay`: let guests look on, on a bus of their own."""

from __future__ import annotations

import select
from typing import TYPE_CHECKING, Annotated, Any

import typer

from offboard.terminal import options
from offboard.terminal.output import err

if TYPE_CHECKING:
    import lcm

    from koopman_lab.bus.realtime import StopSignals


def relay(
    to: Annotated[str, typer.Option("--to", metavar="URL", help="LCM bus of the guests.")],
    read_only: Annotated[
        bool, typer.Option("--read-only", help="Nothing of theirs comes back; there is no other.")
    ] = False,
    config: options.ConfigFile = None,
    overrides: options.Overrides = None,
    url: options.Url = None,
) -> None:
    """Send all that is said on the lab's bus on to another one, until Ctrl-C; nothing comes back.

    Guests see everything with any LCM tool and move nothing. Their bus needs a port of its own.

    Example: klab relay --read-only --to udpm://239.255.76.69:7669?ttl=1
    """
    from koopman_lab.bus.multicast import open_lcm
    from koopman_lab.bus.realtime import StopSignals
    from koopman_lab.config.change import changed
    from koopman_lab.errors import ConfigError

    if not read_only:
        raise ConfigError("relay: only --read-only is there, which never sends anything back")
    lab = options.resolve(config, overrides, None, url=url)
    require_apart(lab.bus.url, to)
    bus, guests = open_lcm(lab), open_lcm(changed(lab, "bus", url=to))
    relayed, stop = ReadOnlyRelay(bus, guests), StopSignals()
    err.print(f"all of {lab.bus.url} is sent on to {to}; nothing comes back; Ctrl-C ends it")
    wait_for: list[Any] = [bus.fileno(), stop]
    with stop.installed():
        while not stop.received:
            select.select(wait_for, (), ())
            _take_all(bus, stop)
    refused = f", {relayed.refused} not taken by the network" if relayed.refused else ""
    err.print(f"{relayed.messages} messages sent on{refused}")


def _take_all(bus: lcm.LCM, stop: StopSignals) -> None:
    from koopman_lab.bus.multicast import drain

    try:
        drain(bus)
    except OSError:
        # LCM's wait ends this way when a signal handler ran in it.
        if not stop.received:
            raise


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
    BusUrlError
        If they are on one port, or one of them is no bus of a network.
    """
    from koopman_lab.errors import BusUrlError

    port, guests_port = _port(source), _port(guests)
    if port == guests_port:
        raise BusUrlError(
            f"--to {guests}: on the port of the lab's bus, {port}, a machine hears both, and what "
            f"guests say would come back; take another port, for example {port + 1}"
        )


def _port(url: str) -> int:
    from koopman_lab.bus.bus_url import parse_bus_url
    from koopman_lab.errors import BusUrlError

    address = parse_bus_url(url)
    if address.scheme != "udpm":
        raise BusUrlError(f"{url}: cannot be relayed; expected udpm://GROUP:PORT?ttl=N")
    return address.port

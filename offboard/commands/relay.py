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
    from koopman_lab.bus.relay import ReadOnlyRelay, require_apart
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

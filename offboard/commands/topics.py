"""`klab topics`: what flows on the bus."""

from __future__ import annotations

import json
import struct
from typing import TYPE_CHECKING, Annotated

import typer

from offboard.terminal import options
from offboard.terminal.exit_codes import ExitCode
from offboard.terminal.output import err, out
from offboard.terminal.visible_text import one_line, visible_json

if TYPE_CHECKING:
    from collections.abc import Callable

    from rich.table import Table

    from koopman_lab.bus.node import RawHandler
    from koopman_lab.bus.realtime import Listener
    from koopman_lab.config.schema import LabConfig
    from offboard.monitor.streams import Flow, Streams

REFRESH_S = 0.5
LOOK_S = 0.1
MS = 1e3


def topics(
    echo: Annotated[
        str | None,
        typer.Option("--echo", metavar="CHANNEL", help="Print its messages, one JSON line each."),
    ] = None,
    once: Annotated[
        bool,
        typer.Option("--once", help="Print one table, or with --echo one message, and end."),
    ] = False,
    seconds: Annotated[
        float, typer.Option("--seconds", metavar="S", min=0.1, help="Listen so long for --once, s.")
    ] = 3.0,
    config: options.ConfigFile = None,
    overrides: options.Overrides = None,
    robot: options.Robot = None,
    url: options.Url = None,
    as_json: options.AsJson = False,
) -> None:
    """Show every channel on the bus: rate, nominal rate, jitter, loss, size, age; until Ctrl-C.

    Jitter is the standard deviation of the time between arrivals. Below the table stands which
    streams of a robot have more than one publisher, or numbers that do not count, and where
    messages lack the lab's key, if it has one.

    Example: klab topics --echo R1_MOCAP_POSE --once
    """
    lab = options.resolve(config, overrides, robot, url=url)
    listener = options.listen(lab)
    try:
        if echo is not None:
            _echo(listener, lab, echo, once=once, seconds=seconds)
        else:
            from offboard.monitor.streams import Streams

            streams = Streams()
            listener.overhear(_handler_into(streams), streams.refuse)
            if once or as_json or not out.is_terminal:
                _print_once(listener, lab, streams, seconds, as_json=as_json)
            else:
                _show_until_interrupted(listener, lab, streams)
    except KeyboardInterrupt:
        raise typer.Exit(ExitCode.INTERRUPTED) from None


def _handler_into(streams: Streams) -> RawHandler:
    def take(name: str, data: bytes, arrived_us: int) -> None:
        streams.take(name, data, arrived_us)

    return take


def _print_once(
    listener: Listener, lab: LabConfig, streams: Streams, seconds: float, *, as_json: bool
) -> None:
    from koopman_lab.errors import LabStateError

    spin_for(listener, seconds)
    flows = streams.flows(listener.now_us(), lab)
    if not flows:
        raise LabStateError(
            f"{lab.bus.url}: nothing heard in {seconds:g} s; start a lab with `klab up`, or name "
            "its bus with --url"
        )
    if as_json:
        out.print_json(json.dumps([flow._asdict() for flow in flows]))
    else:
        out.print(_table(flows))
        for line in _doubts(flows):
            err.print(line)


def _show_until_interrupted(listener: Listener, lab: LabConfig, streams: Streams) -> None:
    from rich.console import Group
    from rich.live import Live

    with Live(console=out, auto_refresh=False) as live:
        while True:
            spin_for(listener, REFRESH_S)
            flows = streams.flows(listener.now_us(), lab)
            live.update(Group(_table(flows), *_doubts(flows)), refresh=True)


def _doubts(flows: list[Flow]) -> list[str]:
    """Return a line for each doubt about who speaks."""
    from offboard.monitor.streams import identity_lines, refusal_line

    refused = refusal_line({flow.name: flow.refused for flow in flows if flow.refused})
    return [one_line(line) for line in (*identity_lines(flows), refused) if line]


def _table(flows: list[Flow]) -> Table:
    from rich.cells import cell_len
    from rich.table import Table

    table = Table()
    columns = ["channel", "rate (Hz)", "nominal", "jitter (ms)", "lost", "bytes", "age (s)"]
    doubted = any((flow.publishers or 1) > 1 or _misnumbered(flow) for flow in flows)
    strange = any(flow.undecodable for flow in flows)
    refused = any(flow.refused for flow in flows)
    columns += ["publishers"] * doubted + ["undecodable"] * strange + ["refused"] * refused
    for column in columns:
        table.add_column(column, justify="right")
    # Names are what a person copies; on a narrow terminal numbers give way.
    table.columns[0].justify = "left"
    names = [one_line(flow.name) for flow in flows]
    table.columns[0].min_width = max(map(cell_len, names), default=0)
    for name, flow in zip(names, flows, strict=True):
        table.add_row(
            name,
            "-" if flow.rate_hz is None else f"{flow.rate_hz:.1f}",
            "-" if flow.nominal_hz is None else f"{flow.nominal_hz:.1f}",
            "-" if flow.jitter_s is None else f"{flow.jitter_s * MS:.2f}",
            "-" if flow.lost is None else str(flow.lost),
            str(flow.size),
            "-" if flow.age_s is None else f"{flow.age_s:.1f}",
            *[_publishers_text(flow)] * doubted,
            *[str(flow.undecodable)] * strange,
            *[str(flow.refused)] * refused,
        )
    return table


def _misnumbered(flow: Flow) -> bool:
    return flow.numbering not in (None, "counts")


def _publishers_text(flow: Flow) -> str:
    if flow.publishers is None:
        return "-"
    return f"{flow.publishers}, {flow.numbering}" if _misnumbered(flow) else str(flow.publishers)


def _echo(listener: Listener, lab: LabConfig, name: str, *, once: bool, seconds: float) -> None:
    from koopman_lab.bus.channels import split_name
    from koopman_lab.bus.message_values import plain_values
    from koopman_lab.errors import LabStateError

    channel = split_name(name)[1]
    printed = 0

    def show(heard: str, data: bytes, arrived_us: int) -> None:
        nonlocal printed
        del arrived_us
        if heard != name or (once and printed):
            return
        try:
            message = channel.type.decode(data)
        except (ValueError, struct.error):
            err.print(f"{name}: {len(data)} bytes that are no {channel.type.__name__}")
            return
        out.print(visible_json(json.dumps(plain_values(message))))
        printed += 1

    listener.overhear(show)
    if not once:
        err.print(f"listening to {name}; Ctrl-C ends it")
        while True:
            listener.spin(REFRESH_S)
    spin_for(listener, seconds, lambda: bool(printed))
    if not printed:
        raise LabStateError(f"{name}: silent on {lab.bus.url} for {seconds:g} s")


def spin_for(
    listener: Listener, seconds: float, enough: Callable[[], bool] = lambda: False
) -> None:
    """Take messages for so long (s), or until there is enough."""
    end_us = listener.now_us() + round(seconds * 1e6)
    while not enough() and (left_us := end_us - listener.now_us()) > 0:
        # Looked at also while the bus is silent.
        listener.spin(min(left_us * 1e-6, LOOK_S))

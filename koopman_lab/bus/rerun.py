"""One node once more, in one thread, with the inputs that a log holds.

The node runs in lockstep, in its place among the others, who are there only with what the log says
they sent. A log made in lockstep is repeated to the last bit: each input comes at its time and in
its turn among the node's ticks, and aboard the radio and the clock make the same draws again. In
real time nobody writes down when a tick was run, so there the outputs agree only about.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, NamedTuple

from koopman_lab.bus.channels import ABOARD, CHANNELS, HEARTBEATS, Channel, Owner
from koopman_lab.bus.clock import PPM
from koopman_lab.bus.lockstep import Lockstep
from koopman_lab.bus.node import Node, Port
from koopman_lab.config.schema import LabConfig
from koopman_lab.data.eventlog import Event
from koopman_lab.errors import LogError
from koopman_lab.units import US_PER_S

PLACES: tuple[Owner, ...] = ("plant", "onboard", "logger", "commander", "operator")
"""Who acts when, at equal times."""
LOGGER = PLACES.index("logger")
LATEST_START_S = 5.0
"""A log that begins later after the node's start does not hold what the node went through."""


class Output(NamedTuple):
    """A message of the node, as the logger received it at ``at_us``."""

    at_us: int
    name: str
    data: bytes


class Life(NamedTuple):
    """What a log says of the process that a node ran in.

    Attributes
    ----------
    start_us
        When its timers started (us).
    process
        Its number, 0 in lockstep.
    """

    start_us: int
    process: int

    @property
    def virtual(self) -> bool:
        """Return whether it was in lockstep."""
        return self.process == 0


class Rerun(NamedTuple):
    """What a node said once, and what it says now.

    Attributes
    ----------
    recorded, again
        Messages in order of arrival.
    end_us
        The log's last time (us).
    """

    recorded: list[Output]
    again: list[Output]
    end_us: int


def place_of(publisher: Owner) -> int:
    """Return the place of a publisher among all."""
    drives = publisher in ("sampler", "controller")
    return PLACES.index("commander" if drives else publisher)


def outputs_of(node_name: str) -> list[Channel[Any]]:
    """Return the channels that a node speaks on."""
    mine: set[str] = {node_name}
    if node_name in ("sampler", "controller"):
        mine.add("commander")
    return [channel for channel in CHANNELS if channel.publisher in mine]


def life_of(node_name: str, config: LabConfig, events: Sequence[Event]) -> Life:
    """Return when and in which process a node ran, by its first heartbeat.

    Raises
    ------
    LogError
        If the log holds no heartbeat of the node.
    """
    channel = HEARTBEATS[node_name]
    name = channel.name(config.robot.name)
    data = next((event.data for event in events if event.channel == name), None)
    if data is None:
        raise LogError(
            f"{name}: not in the log, so this {node_name} did not run in it; "
            "`klab log info` shows who did"
        )
    try:
        beat = channel.type.decode(data)
    except ValueError:
        raise LogError(
            f"{name}: recorded with other message types; run again with the version of "
            "koopman-lab that recorded the log, or record it anew"
        ) from None
    if beat.pid == 0:
        return Life(0, 0)
    age_us = beat.sequence / config.bus.heartbeat_rate_hz * US_PER_S
    start_us = beat.utime - round(age_us)
    if node_name == ABOARD:
        start_us -= round(config.clock.offset_s * US_PER_S + age_us * config.clock.drift_ppm * PPM)
    late_us = events[0].timestamp_us - start_us
    if late_us > LATEST_START_S * US_PER_S:
        # Ticks keep their places; what happened before the log nobody knows.
        start_us += late_us // US_PER_S * US_PER_S
    return Life(start_us, beat.pid)


class _Nobody:
    """Holds a place."""

    name = ""

    def attach(self, port: Port) -> None:
        """Say nothing."""

    def close(self) -> None:
        """Nothing is held."""


class _Collector(_Nobody):
    """Takes what the node sends, in the logger's place."""

    def __init__(self, channels: Sequence[Channel[Any]]) -> None:
        self.heard: list[Output] = []
        self._channels = channels

    def attach(self, port: Port) -> None:
        """Listen to the node."""
        for channel in self._channels:
            port.subscribe_raw(channel, self._on_message)

    def _on_message(self, name: str, data: bytes, arrived_us: int) -> None:
        self.heard.append(Output(arrived_us, name, data))


def rerun(
    node: Node,
    config: LabConfig,
    events: Sequence[Event],
    life: Life,
    on_progress: Callable[[float], None] | None = None,
) -> Rerun:
    """Run a node with its recorded inputs, to its own finish or the end of the log.

    Parameters
    ----------
    node
        As it was made for the record; not attached yet.
    config
        The lab of the record.
    events
        Of a log, in the order they were written; at least one.
    life
        From :func:`life_of`.
    on_progress
        Told the time in s once every virtual second.
    """
    mine = outputs_of(node.name)
    names = {channel.name(config.robot.name) for channel in mine}
    collector = _Collector(mine)
    lab = Lockstep(config, life.start_us, life.process)
    here = place_of(node.name)  # type: ignore[arg-type]
    for place in range(len(PLACES)):
        lab.add(node if place == here else collector if place == LOGGER else _Nobody())
    places = {c.name(config.robot.name): place_of(c.publisher) for c in CHANNELS}
    before_us = None
    for event in events:
        at_us, name = event.timestamp_us, event.channel
        if name not in names and name in lab.routes and at_us >= life.start_us:
            place = places[name]
            if PLACES[place] == "operator" and at_us != before_us:
                # Whoever is no node speaks between two times: before all others if first.
                place = 0
            lab.push(at_us, place, _sender(lab, name, event.data))
        before_us = at_us
    end_us = max(event.timestamp_us for event in events)
    try:
        lab.run((end_us - life.start_us) / US_PER_S, on_progress=on_progress)
    finally:
        lab.close()
    recorded = [Output(e.timestamp_us, e.channel, e.data) for e in events if e.channel in names]
    return Rerun(recorded, collector.heard, end_us)


def _sender(lab: Lockstep, name: str, data: bytes) -> Callable[[int], None]:
    send = partial(lab.send, name, data)
    return lambda _: send()

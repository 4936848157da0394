"""One node once more, in one thread, with the inputs that a log holds.

The node runs in lockstep, in its place among the others, who are there only with what the log says
they sent. A log made in lockstep is repeated to the last bit: each input comes at its time and in
its turn among the node's ticks, and aboard the radio and the clock make the same draws again. In
real time nobody writes down when a tick was run, so there the outputs agree only about.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

from koopman_lab.bus.channel import ABOARD, COMMANDER, OPERATOR, SUPERVISOR, Channel
from koopman_lab.bus.channels import all_channels
from koopman_lab.bus.lockstep import Lockstep, message_rank
from koopman_lab.bus.node import Node, Port
from koopman_lab.bus.processes import STANDING, commanders
from koopman_lab.bus.subscription import Deliver
from koopman_lab.config.schema import LabConfig
from koopman_lab.emulation.board import emulated_board
from koopman_lab.eventlog.eventlog import Event
from koopman_lab.replay.message_types import require_readable, unreadable_channels
from koopman_lab.replay.recorded_process import RecordedProcess
from koopman_lab.units import US_PER_S

PLACES = (*STANDING, COMMANDER, OPERATOR, SUPERVISOR)
"""Publishers in the order in which they act at equal times."""
LOGGER = PLACES.index("logger")


class Output(NamedTuple):
    """A message of the node, as the logger received it at ``at_us``."""

    at_us: int
    name: str
    data: bytes


class Rerun(NamedTuple):
    """What a node said once, and what it says now.

    Attributes
    ----------
    recorded, again
        Messages in order of arrival.
    end_us
        The log's last time (us).
    passed_over
        Channels that cannot be read, with the number of their messages; neither list has them.
    """

    recorded: list[Output]
    again: list[Output]
    end_us: int
    passed_over: dict[str, int]


def place_of(publisher: str) -> int:
    """Return the place of a publisher among all; who is no part of a lab acts with who commands."""
    return PLACES.index(publisher if publisher in PLACES else COMMANDER)


def outputs_of(node_name: str) -> list[Channel[Any]]:
    """Return the channels that a node speaks on."""
    publishers: set[str] = {node_name}
    if node_name in commanders():
        publishers.add(COMMANDER)
    return [channel for channel in all_channels() if channel.publisher in publishers]


class _Placeholder:
    """A node that says nothing, so that the others keep their places."""

    name = ""

    def attach(self, port: Port) -> None:
        """Say nothing."""

    def close(self) -> None:
        """Nothing is held."""


class _Collector(_Placeholder):
    """Takes what the node sends, in the logger's place."""

    def __init__(self, channels: Sequence[Channel[Any]]) -> None:
        self.outputs: list[Output] = []
        self._channels = channels

    def attach(self, port: Port) -> None:
        """Listen to the node."""
        for channel in self._channels:
            port.subscribe_raw(channel, self._on_message)

    def _on_message(self, name: str, data: bytes, arrived_us: int) -> None:
        self.outputs.append(Output(arrived_us, name, data))


def rerun(
    node: Node,
    config: LabConfig,
    events: Sequence[Event],
    process: RecordedProcess,
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
        Events of a log, in the order they were written; at least one.
    process
        From :func:`~koopman_lab.replay.recorded_process.recorded_process`.
    on_progress
        Told the time in s once every virtual second.

    Raises
    ------
    LogError
        If messages that the node listens to cannot be read.
    """
    outputs = outputs_of(node.name)
    names = {channel.name(config.robot.name) for channel in outputs}
    collector = _Collector(outputs)
    lab = Lockstep(config, process.start_us, process.process)
    node_place = place_of(node.name)
    board = emulated_board(config) if node.name == ABOARD and process.simulated else None
    for place in range(len(PLACES)):
        if place == node_place:
            lab.add(node, board)
        else:
            lab.add(collector if place == LOGGER else _Placeholder())
    unreadable = unreadable_channels(config, events)
    require_readable(lab.routes.keys() - names, unreadable)
    places = {c.name(config.robot.name): place_of(c.publisher) for c in all_channels()}
    before_us = None
    for event in events:
        at_us, name = event.timestamp_us, event.channel
        if name not in names and name in lab.routes and at_us >= process.start_us:
            place = places[name]
            if PLACES[place] == OPERATOR and at_us != before_us:
                # Whoever is no node speaks between two times: before all others if first.
                place = 0
            lab.push(at_us, message_rank(place), _sender(lab, name), event.data)
        before_us = at_us
    end_us = max(event.timestamp_us for event in events)
    try:
        lab.run((end_us - process.start_us) / US_PER_S, on_progress=on_progress)
    finally:
        lab.close()
    compared = names - unreadable.keys()
    recorded = [Output(e.timestamp_us, e.channel, e.data) for e in events if e.channel in compared]
    again = [output for output in collector.outputs if output.name in compared]
    return Rerun(recorded, again, end_us, unreadable)


def _sender(lab: Lockstep, name: str) -> Deliver:
    return lambda data, _: lab.send(name, data)

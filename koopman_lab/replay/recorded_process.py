"""What a log says of the process that a node ran in, and whether the node can be run again."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from typing import Any, NamedTuple

from koopman_lab.bus.channel import ABOARD
from koopman_lab.bus.channels import HEARTBEATS
from koopman_lab.bus.processes import commanders, process
from koopman_lab.bus.sequence import SequenceCounter
from koopman_lab.config.schema import LabConfig
from koopman_lab.errors import LogError
from koopman_lab.eventlog.eventlog import Event
from koopman_lab.replay.message_types import require_readable, unreadable_channels
from koopman_lab.replay.timed_replay import rhythm
from koopman_lab.units import PPM, US_PER_S

LATEST_START_S = 5.0
"""A log that begins later after the node's start does not hold what the node went through."""


class RecordedProcess(NamedTuple):
    """How a node's process was when a log was recorded.

    Attributes
    ----------
    start_us
        When its timers started (us).
    process
        Its number, 0 in lockstep.
    simulated
        Whether a plant stood in for the robot.
    """

    start_us: int
    process: int
    simulated: bool

    @property
    def virtual(self) -> bool:
        """Return whether it was in lockstep."""
        return self.process == 0


def recorded_process(node_name: str, config: LabConfig, events: Sequence[Event]) -> RecordedProcess:
    """Return when and in which process a node ran, by its heartbeats.

    Raises
    ------
    LogError
        If the log does not hold one whole life of the node, in heartbeats of this version.
    """
    _require_steady_times(events)
    name = HEARTBEATS[node_name].name(config.robot.name)
    require_readable([name], unreadable_channels(config, events))
    beats = _heartbeats(node_name, config, events)
    if not beats:
        raise LogError(
            f"{name}: not in the log, so this {node_name} did not run in it; "
            "`klab log info` shows who did"
        )
    other_commanders = sorted(commanders() - {node_name}) if process(node_name).commands else []
    for other in other_commanders:
        if _heartbeats(other, config, events):
            raise LogError(
                f"{name}: the log holds a {other} as well, on the same channels; "
                "record one session to a log"
            )
    processes, counter = {beat.pid for _, beat in beats}, SequenceCounter()
    for _, beat in beats:
        counter.update(beat.sequence, beat.utime)
    starts = max(len(processes), 1 + counter.restarts)
    if starts > 1:
        raise LogError(
            f"{name}: {node_name} was started {starts} times in this log, as in a session that was "
            "resumed; only a log of one start can be run again"
        )
    # Whoever commands a real robot may have a configuration in which something is simulated.
    simulated = config.simulation is not None and bool(_heartbeats("plant", config, events))
    arrived_us, first = beats[0]
    age_us = round(first.sequence / config.bus.heartbeat_rate_hz * US_PER_S)
    if first.pid == 0:
        if abs(arrived_us - age_us) > LATEST_START_S * US_PER_S:
            raise LogError(
                f"{name}: this log was recorded from a replay, and its times of arrival are not "
                "those of the session; give the session's own log"
            )
        return RecordedProcess(0, 0, simulated)
    start_us = first.utime - age_us
    if node_name == ABOARD and simulated:
        clock = config.require_simulation().clock
        start_us -= round(clock.offset_s * US_PER_S + age_us * clock.drift_ppm * PPM)
    late_us = events[0].timestamp_us - start_us
    if start_us > events[-1].timestamp_us:
        raise LogError(
            f"{name}: stamped {-late_us / US_PER_S:.0f} s after the log begins, when it was over; "
            f"the clock of the {node_name} was wrong, and when its ticks were run nobody knows"
        )
    if late_us > LATEST_START_S * US_PER_S:
        # Ticks keep their places; what happened before the log nobody knows.
        start_us += late_us // US_PER_S * US_PER_S
    return RecordedProcess(start_us, first.pid, simulated)


def _require_steady_times(events: Sequence[Event]) -> None:
    _, jumps = rhythm([event.timestamp_us for event in events])
    if jumps:
        raise LogError(
            f"times of arrival jump {jumps} times in this log: the clock was set, or they are "
            "damaged; a node can be run again only where time goes on"
        )


def _heartbeats(
    node_name: str, config: LabConfig, events: Sequence[Event]
) -> list[tuple[int, Any]]:
    """Return when each heartbeat arrived (us), and the heartbeat."""
    channel = HEARTBEATS[node_name]
    name, beats = channel.name(config.robot.name), []
    for event in events:
        if event.channel == name:
            try:
                beats.append((event.timestamp_us, channel.type.decode(event.data)))
            except (ValueError, struct.error):
                continue
    return beats

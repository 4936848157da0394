"""Who is alive: heartbeats, and what the commands that started processes say of them."""

from __future__ import annotations

from typing import Any, NamedTuple

import lcmtypes
from koopman_lab.bus.channels import HEARTBEATS
from koopman_lab.units import US_PER_S
from offboard.processes import NAMES, PROCESSES
from offboard.viewer.latest import Latest

SILENT_S = 1.6
"""Three heartbeats missing."""
ALIVE, SILENT, FINISHED, DIED = "alive", "silent", "finished", "died"


class Entry(NamedTuple):
    """One process at one time.

    Attributes
    ----------
    name
        The node.
    state
        alive, silent, finished or died.
    pid
        Its process id.
    age_s
        Since it was heard last (s).
    missed_ticks, lost_messages, worst_lateness_us
        By its newest heartbeat; None for a process that has none.
    needs, stopped_by
        From the table of processes.
    told
        What the command that started it said last, None if nobody said anything.
    """

    name: str
    state: str
    pid: int
    age_s: float
    missed_ticks: int | None
    lost_messages: int | None
    worst_lateness_us: int | None
    needs: tuple[str, ...]
    stopped_by: str
    told: lcmtypes.process_t | None


class Roll:
    """Of one robot."""

    def __init__(self) -> None:
        self._beats = {name: Latest(channel) for name, channel in HEARTBEATS.items()}
        self._told: dict[str, tuple[int, lcmtypes.process_t]] = {}

    def beat(self, name: str, data: bytes, arrived_us: int) -> None:
        """Take a heartbeat of a node."""
        self._beats[name].take(data, arrived_us)

    def tell(self, message: lcmtypes.process_t, arrived_us: int) -> None:
        """Take what a command says of a process it started; names of no process say nothing."""
        if message.name in NAMES:
            self._told[message.name] = arrived_us, message

    def entries(self, now_us: int) -> list[Entry]:
        """Return every process that was ever heard of, in the order of the table."""
        entries = []
        for row in PROCESSES:
            beat: Any = self._beats[row.name].read() if row.name in self._beats else None
            heard_us = self._beats[row.name].arrived_us if beat is not None else 0
            told_us, told = self._told.get(row.name, (0, None))
            if beat is None and told is None:
                continue
            # A node that is started again by another hand outlives what was said of the first.
            if (
                told is not None
                and beat is not None
                and heard_us > told_us
                and told.pid != beat.pid
            ):
                told = None
            newest_us = heard_us
            if told is not None and told.state == told.RUNNING and beat is None:
                newest_us = told_us
            if told is not None and told.state in (told.FINISHED, told.DIED):
                state = DIED if told.state == told.DIED else FINISHED
                newest_us = max(heard_us, told_us)
            else:
                state = ALIVE if now_us - newest_us <= SILENT_S * US_PER_S else SILENT
            source = told if told is not None else beat
            entries.append(
                Entry(
                    row.name,
                    state,
                    source.pid,
                    (now_us - newest_us) / US_PER_S,
                    None if beat is None else beat.missed_ticks,
                    None if beat is None else beat.lost_messages,
                    None if beat is None else beat.worst_lateness_us,
                    row.needs,
                    row.stopped_by,
                    told,
                )
            )
        return entries

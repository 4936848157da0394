"""The state of each process of a robot: by its heartbeats, and by who started it."""

from __future__ import annotations

from typing import NamedTuple

import lcmtypes
from koopman_lab.bus.channels import HEARTBEATS
from koopman_lab.bus.processes import PROCESSES, Process, in_stop_order, who_stops
from koopman_lab.units import US_PER_S
from offboard.monitor.latest_message import LatestMessage

SILENT_S = 1.6
"""Three heartbeats missing."""
ALIVE, STARTING, SILENT = "alive", "starting", "silent"
FINISHED, DIED = "finished", "died"
MOST_OF_A_NAME = 8
"""Processes that are kept in mind; who invents process ids endlessly fills no memory here."""


class ProcessState(NamedTuple):
    """One process at one time.

    Attributes
    ----------
    name
        The node.
    state
        alive, starting, silent, finished or died.
    pid
        Its process id.
    age_s
        Since it was heard last (s); None if it never was.
    missed_ticks, lost_messages, worst_lateness_us
        By its newest heartbeat; None for a process that has none.
    needs, stopped_by
        From the table of processes.
    report
        What the command that started it said last, None if nobody said anything.
    """

    name: str
    state: str
    pid: int
    age_s: float | None
    missed_ticks: int | None
    lost_messages: int | None
    worst_lateness_us: int | None
    needs: tuple[str, ...]
    stopped_by: str
    report: lcmtypes.process_t | None


class _Record:
    """Heartbeats of one process and reports on it, with the times of arrival (us)."""

    def __init__(self, now_us: int) -> None:
        self.first_us = self.last_us = self.heard_us = self.reported_us = now_us
        self.beat: lcmtypes.node_status_t | None = None
        self.report: lcmtypes.process_t | None = None

    def take_heartbeat(self, beat: lcmtypes.node_status_t, now_us: int) -> None:
        self.beat, self.heard_us, self.last_us = beat, now_us, now_us

    def take_report(self, report: lcmtypes.process_t, now_us: int) -> None:
        self.report, self.reported_us, self.last_us = report, now_us, now_us

    def state(self, name: str, now_us: int) -> str:
        """Return how it is; its own heartbeat weighs more than what others report."""
        report = self.report
        if report is not None and report.state in (report.FINISHED, report.DIED):
            return DIED if report.state == report.DIED else FINISHED
        newest_us = self.reported_us if self.beat is None else self.heard_us
        if now_us - newest_us > SILENT_S * US_PER_S:
            return SILENT
        if self.beat is None and report is not None and name in HEARTBEATS:
            return {report.STARTING: STARTING, report.SILENT: SILENT}.get(report.state, ALIVE)
        return ALIVE

    def age_s(self, name: str, state: str, now_us: int) -> float | None:
        """Return since when nothing was heard of it (s)."""
        if state in (FINISHED, DIED):
            newest_us = self.last_us
        elif self.beat is not None:
            newest_us = self.heard_us
        elif name in HEARTBEATS and state != ALIVE:
            return None
        else:
            newest_us = self.reported_us
        return (now_us - newest_us) / US_PER_S


class ProcessStates:
    """All processes of one robot.

    Several may run the same node: each command has its own logger.
    """

    def __init__(self) -> None:
        self._known: dict[str, dict[int, _Record]] = {}

    def take_heartbeat(self, name: str, data: bytes, arrived_us: int) -> None:
        """Take a heartbeat of a node; what is none says nothing."""
        latest = LatestMessage(HEARTBEATS[name])
        latest.take(data, arrived_us)
        beat = latest.read()
        if beat is not None:
            self._record_of(name, beat.pid, arrived_us).take_heartbeat(beat, arrived_us)

    def take_report(self, message: lcmtypes.process_t, arrived_us: int) -> None:
        """Take what a command says of a process it started; names of no process say nothing."""
        if message.name in PROCESSES:
            self._record_of(message.name, message.pid, arrived_us).take_report(message, arrived_us)

    def entries(self, now_us: int) -> list[ProcessState]:
        """Return every process that counts, in the order of stopping, then of their beginning.

        One that ended, or fell silent, counts until the node is started again; one that finished,
        only until another that runs the node is heard.
        """
        entries = []
        for row in in_stop_order():
            records = self._known.get(row.name, {})
            for pid, record in records.items():
                state = record.state(row.name, now_us)
                others = [other for other in records.values() if other is not record]
                if state not in (ALIVE, STARTING) and any(
                    o.first_us > record.last_us for o in others
                ):
                    continue
                if state == FINISHED and any(o.last_us > record.last_us for o in others):
                    continue
                entries.append(_entry(row, pid, record, state, now_us))
        return entries

    def _record_of(self, name: str, pid: int, now_us: int) -> _Record:
        """Return what is known of a process; the one heard of longest ago makes room."""
        records = self._known.setdefault(name, {})
        if pid not in records:
            if len(records) == MOST_OF_A_NAME:
                del records[min(records, key=lambda p: records[p].last_us)]
            records[pid] = _Record(now_us)
        return records[pid]


def _entry(row: Process, pid: int, record: _Record, state: str, now_us: int) -> ProcessState:
    beat = record.beat
    return ProcessState(
        row.name,
        state,
        pid,
        record.age_s(row.name, state, now_us),
        None if beat is None else beat.missed_ticks,
        None if beat is None else beat.lost_messages,
        None if beat is None else beat.worst_lateness_us,
        row.needs,
        who_stops(row, record.report),
        record.report,
    )

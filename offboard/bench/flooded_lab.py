"""`klab bench flood`: a lab that drives under a flood of mutated datagrams, and without it."""

from __future__ import annotations

import contextlib
import json
import subprocess
from collections.abc import Callable, Iterator
from functools import partial
from typing import TYPE_CHECKING, NamedTuple

from koopman_lab.config.schema import LabConfig
from koopman_lab.errors import LabStateError
from offboard.lab.process_cost import cpu_time_s, most_memory_mb
from offboard.lab.python_process import module_command

if TYPE_CHECKING:
    from rich.table import Table

    from offboard.bench.driven_lab import DrivenLab

NODES = ("plant", "onboard", "logger", "sampler")
QUIET, FLOODED = "without a flood", "flooded"


class Row(NamedTuple):
    """How the lab went.

    Attributes
    ----------
    datagrams, datagrams_per_s
        Of the flood.
    death
        Which process ended, and how; empty if none did.
    camera_frames, camera_frames_lost
        Stored by the logger, and missing between the first and the last stored one.
    lost
        Missing on all channels.
    ticks, missed_ticks
        Of the process of the motor loop.
    refused
        Messages on channels of the lab that were none, as logger and motor loop counted them.
    cpu_share, memory_mb
        Of each node: of one core, and the largest resident memory; empty after a death.
    """

    datagrams: int
    datagrams_per_s: float
    death: str
    camera_frames: int
    camera_frames_lost: int
    lost: int
    ticks: int
    missed_ticks: int
    refused: int
    cpu_share: dict[str, float]
    memory_mb: dict[str, float]


def measure(driven: DrivenLab, heard_share: float | None) -> Row:
    """Let the sampler drive the robot, with or without a flood beside it.

    Parameters
    ----------
    driven
        The lab, and for how long.
    heard_share
        Of the datagrams of the flood, those on channels of the lab; None for no flood.

    Raises
    ------
    LabStateError
        If the lab does not start.
    """
    import lcmtypes
    from koopman_lab.bus.channels import HEARTBEATS, MOCAP_POSE
    from koopman_lab.data.decode import SessionLog
    from offboard.lab.supervisor import start_missing, supervised

    config, folder, seconds = driven.config, driven.folder, driven.seconds
    beats: dict[str, lcmtypes.node_status_t] = {}
    for name in ("onboard", "logger"):
        driven.listener.subscribe(HEARTBEATS[name], partial(beats.__setitem__, name))
    death, cpu_share, memory_mb = "", dict[str, float](), dict[str, float]()
    sent: tuple[int, float] = (0, 0.0)
    with supervised(config, folder, driven.listener) as lab, contextlib.ExitStack() as stack:
        start_missing(lab, set(), folder)
        flood: subprocess.Popen[str] | None = None
        before: dict[str, float] = {}

        def watch(passed_s: float) -> None:
            nonlocal flood
            if not before:
                before.update({name: cpu_time_s(lab.process(name)) for name in NODES})
            if heard_share is not None and flood is None:
                flood = stack.enter_context(_flood(config, seconds - passed_s, heard_share))

        try:
            driven.drive(lab, watch)
            pids = {name: lab.process(name) for name in NODES}
            cpu_share = {n: (cpu_time_s(pid) - before[n]) / seconds for n, pid in pids.items()}
            memory_mb = {name: most_memory_mb(pid) for name, pid in pids.items()}
        except LabStateError as error:
            if not before:
                raise
            death = str(error)
        if flood is not None:
            flood.terminate()
            count, flood_s = json.loads(flood.communicate()[0] or "[0, 0.0]")
            sent = count, flood_s
    channels = SessionLog(folder.log, salvage=True).channels
    cameras = channels[MOCAP_POSE.name(config.robot.name)]
    return Row(
        sent[0],
        sent[0] / sent[1] if sent[1] else 0.0,
        death,
        cameras.count - cameras.unreadable,
        cameras.lost,
        sum(channel.lost for channel in channels.values()),
        beats["onboard"].ticks,
        beats["onboard"].missed_ticks,
        sum(beat.undecodable_messages for beat in beats.values()),
        cpu_share,
        memory_mb,
    )


def as_table(rows: dict[str, Row], camera_rate_hz: float, seconds: float) -> Table:
    """Return the figures as a table."""
    from rich.table import Table

    table = Table("", title=f"cameras at {camera_rate_hz:g} Hz, {seconds:g} s")
    for name in rows:
        table.add_column(name, justify="right")

    def line(what: str, text: Callable[[Row], str]) -> None:
        table.add_row(what, *map(text, rows.values()))

    line("datagrams a second", lambda row: f"{row.datagrams_per_s:.0f}")
    line("deaths", lambda row: row.death or "none")
    line("camera frames", lambda row: str(row.camera_frames))
    line("camera frames lost", lambda row: str(row.camera_frames_lost))
    line("messages lost", lambda row: str(row.lost))
    line("messages that are none", lambda row: str(row.refused))
    line("ticks missed", lambda row: f"{row.missed_ticks} of {row.ticks + row.missed_ticks}")
    for node in NODES:
        table.add_row(
            f"CPU of {node}", *(_cost(r.cpu_share, node, 1e2, "%") for r in rows.values())
        )
        table.add_row(
            f"memory of {node}", *(_cost(r.memory_mb, node, 1, "MB") for r in rows.values())
        )
    return table


def _cost(costs: dict[str, float], node: str, factor: float, unit: str) -> str:
    return f"{factor * costs[node]:.1f} {unit}" if node in costs else ""


@contextlib.contextmanager
def _flood(
    config: LabConfig, seconds: float, heard_share: float
) -> Iterator[subprocess.Popen[str]]:
    """Give a process that floods the bus for so long."""
    whom = (config.bus.url, config.robot.name)
    how = (str(seconds), str(heard_share))
    command = module_command("offboard.bench.datagram_flood", *whom, *how)
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        try:
            yield process
        finally:
            process.kill()

"""`klab bench logger`: our logger and lcm-logger record the same bus, and both are measured."""

from __future__ import annotations

import subprocess
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from koopman_lab.config.schema import LabConfig
from offboard.lab.process_cost import cpu_time_s, most_memory_mb

if TYPE_CHECKING:
    from rich.table import Table

    from offboard.bench.driven_lab import DrivenLab

OURS, THEIRS = "klab run logger", "lcm-logger"
PATIENCE_S = 10.0


class Row(NamedTuple):
    """What one logger did.

    Attributes
    ----------
    events
        Messages stored.
    camera_frames, camera_frames_lost
        Stored, and missing between the first and the last stored one by their numbers.
    lost
        Missing on all channels.
    cpu_share
        CPU time over real time.
    memory_mb
        Largest resident memory.
    """

    events: int
    camera_frames: int
    camera_frames_lost: int
    lost: int
    cpu_share: float
    memory_mb: float


def measure(driven: DrivenLab) -> dict[str, Row]:
    """Record a calibration with both loggers at once.

    Both have the same receive buffer and, where it is permitted, the same priority.

    Parameters
    ----------
    driven
        The lab, for how long, and where both logs go.

    Raises
    ------
    LabStateError
        If a process dies or the robot is not driven.
    """
    import lcm

    from koopman_lab.bus.multicast import bus_url
    from koopman_lab.bus.priority import ask_for_priority
    from offboard.lab.supervisor import start_missing, supervised

    config, folder = driven.config, driven.folder
    theirs = folder.path / "lcm-logger.lcm"
    # The binary: the wheel's wrapper script does not hand signals on.
    binary = Path(lcm.LCM_BIN_DIR) / "lcm-logger"
    with supervised(config, folder, driven.listener) as lab:
        peer = subprocess.Popen(
            [binary, f"--lcm-url={bus_url(config)}", "--quiet", theirs],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            preexec_fn=ask_for_priority,
        )
        try:
            start_missing(lab, set(), folder)
            processes = {OURS: lab.process("logger"), THEIRS: peer.pid}
            before = {name: cpu_time_s(pid) for name, pid in processes.items()}
            driven.drive(lab)
            used = {name: cpu_time_s(pid) - before[name] for name, pid in processes.items()}
            memory = {name: most_memory_mb(pid) for name, pid in processes.items()}
        finally:
            peer.terminate()
            peer.wait(PATIENCE_S)
    logs = {OURS: folder.log, THEIRS: theirs}
    return {
        name: _row(log, config, used[name] / driven.seconds, memory[name])
        for name, log in logs.items()
    }


def as_table(rows: dict[str, Row], camera_rate_hz: float, seconds: float) -> Table:
    """Return the figures as a table."""
    from rich.table import Table

    table = Table("logger", title=f"cameras at {camera_rate_hz:g} Hz, {seconds:g} s")
    for column in ("messages", "camera frames", "frames lost", "lost", "CPU", "memory"):
        table.add_column(column, justify="right")
    for name, row in rows.items():
        table.add_row(
            name,
            *map(str, row[:4]),
            f"{100.0 * row.cpu_share:.1f} %",
            f"{row.memory_mb:.0f} MB",
        )
    return table


def _row(log: Path, config: LabConfig, cpu_share: float, memory_mb: float) -> Row:
    from koopman_lab.bus.channels import MOCAP_POSE
    from koopman_lab.data.decode import SessionLog

    channels = SessionLog(log).channels
    cameras = channels[MOCAP_POSE.name(config.robot.name)]
    return Row(
        sum(channel.count for channel in channels.values()),
        cameras.count,
        cameras.lost,
        sum(channel.lost for channel in channels.values()),
        cpu_share,
        memory_mb,
    )

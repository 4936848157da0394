"""`klab bench realtime`: how regularly the motor loop ticks beside a calibration."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

from koopman_lab.bus.pacing import Pacing, load_tick_times, pacing

if TYPE_CHECKING:
    from rich.table import Table

    from offboard.bench.driven_lab import DrivenLab

STATISTICS = Path("/proc/stat")
STEAL = 8
"""Word of its first line: involuntary wait, in ticks of the clock, over all CPUs."""
WORDS = {"onboard": "motor loop", "pacer": "only waiting"}


def measure(driven: DrivenLab) -> dict[str, Pacing]:
    """Run plant, onboard loop, logger and sampler, and beside them a process that only waits.

    Parameters
    ----------
    driven
        The lab, for how long, and where the tick times go.

    Returns
    -------
    The pacing of the 100 Hz ticks by process: ``onboard`` and ``pacer``. What the latter shows is
    the machine's share.

    Raises
    ------
    ConfigError
        If nothing is simulated.
    LabStateError
        If a process dies or the robot is not driven.
    """
    from offboard.lab.supervisor import supervised

    config, folder = driven.config, driven.folder
    config.require_simulation()
    files = {name: folder.path / f"{name}-ticks.npy" for name in WORDS}
    with supervised(config, folder, driven.listener) as lab:
        lab.start("logger", "--folder", folder.path)
        lab.start("plant")
        for name, file in files.items():
            lab.start(name, "--tick-times", file)
        lab.wait_ready("logger", "plant", "onboard")
        driven.drive(lab)
    rate_hz = config.motor_loop.rate_hz
    return {name: pacing(load_tick_times(file), rate_hz) for name, file in files.items()}


def stolen_s() -> float | None:
    """Return the CPU time (s) that a host has taken from this virtual machine, None if unknown."""
    try:
        fields = STATISTICS.read_text().split()
        return int(fields[STEAL]) / os.sysconf("SC_CLK_TCK")
    except (OSError, IndexError, ValueError):
        return None


def as_table(pacings: dict[str, Pacing], rate_hz: float) -> Table:
    """Return the figures as a table."""
    from rich.table import Table

    table = Table(f"{rate_hz:g} Hz", title="period in ms")
    for column in ("p50", "p99", "p99.9", "max", "99 % within", "ticks", "missed"):
        table.add_column(column, justify="right")
    for name, row in pacings.items():
        table.add_row(
            WORDS[name],
            *(f"{ms:.2f}" for ms in row[3:7]),
            f"{row.error_p99_ms:.2f}",
            str(row.ticks),
            f"{row.missed} ({100.0 * row.missed_share:.3f} %)",
        )
    return table

"""How regularly the motor loop ticks in real time, beside a calibration."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from koopman_lab.bus.pacing import Pacing, load_tick_times, pacing
from koopman_lab.config.schema import LabConfig
from koopman_lab.errors import LabStateError

if TYPE_CHECKING:
    from rich.table import Table

    from koopman_lab.bus.realtime import Listener
    from offboard.console.folder import RunFolder

WAIT_S = 1.0
MORE_THAN_ENOUGH = 10_000
"""Segments per basis input: more than fit into any measurement."""
START_LIMIT_S = 30.0
STATISTICS = Path("/proc/stat")
STEAL = 8
"""Word of its first line: involuntary wait, in ticks of the clock, over all CPUs."""
WORDS = {"onboard": "motor loop", "pacer": "only waiting"}


def measure(
    config: LabConfig,
    folder: RunFolder,
    listener: Listener,
    seconds: float,
    report: Callable[[float], None],
) -> dict[str, Pacing]:
    """Run plant, onboard loop, logger and sampler, and beside them a process that only waits.

    Parameters
    ----------
    config
        The lab; the sampler must have more to do than there is time.
    folder
        Takes the session log and the tick times.
    listener
        This process's ear on the bus.
    seconds
        From the moment the robot is driven.
    report
        Told the seconds that have passed.

    Returns
    -------
    The pacing of the 100 Hz ticks by process: ``onboard`` and ``pacer``. What the latter shows is
    the machine's share.

    Raises
    ------
    LabStateError
        If a process dies or the robot is not driven.
    """
    import lcmtypes
    from koopman_lab.bus.channels import ONBOARD_STATUS
    from offboard.console.supervisor import supervised

    files = {name: folder.path / f"{name}-ticks.npy" for name in WORDS}
    statuses: list[lcmtypes.onboard_status_t] = []
    listener.subscribe(ONBOARD_STATUS, statuses.append)
    with supervised(config, folder, listener) as lab:
        lab.start("logger", "--folder", folder.path)
        lab.start("plant")
        for name, file in files.items():
            lab.start(name, "--tick-times", file)
        lab.wait_ready("logger", "plant", "onboard")
        lab.start("sampler")
        began_s = time.monotonic()
        while not (statuses and statuses[-1].state == statuses[-1].DRIVING):
            del statuses[:-1]
            listener.spin(WAIT_S)
            lab.check()
            if time.monotonic() - began_s > START_LIMIT_S:
                raise LabStateError(
                    f"{ONBOARD_STATUS.name(config.robot.name)}: the robot is not driven within "
                    f"{START_LIMIT_S:g} s; {folder.process_log('sampler')} may say why"
                )
        began_s = time.monotonic()
        while (passed_s := time.monotonic() - began_s) < seconds:
            statuses.clear()
            listener.spin(min(WAIT_S, seconds - passed_s))
            lab.check()
            if lab.ended("sampler"):
                raise LabStateError(
                    f"sampler: ended after {passed_s:.0f} s; raise sampler.segments_per_basis"
                )
            report(passed_s)
    rate_hz = config.motor_loop.rate_hz
    return {name: pacing(load_tick_times(file), rate_hz) for name, file in files.items()}


def stolen_s() -> float | None:
    """Return the CPU time (s) that a host has taken from this virtual machine, None if unknown."""
    try:
        fields = STATISTICS.read_text().split()
        return int(fields[STEAL]) / os.sysconf("SC_CLK_TCK")
    except (OSError, IndexError, ValueError):
        return None


def as_table(found: dict[str, Pacing], rate_hz: float) -> Table:
    """Return the figures as a table."""
    from rich.table import Table

    table = Table(f"{rate_hz:g} Hz", title="period in ms")
    for column in ("p50", "p99", "p99.9", "max", "99 % within", "ticks", "missed"):
        table.add_column(column, justify="right")
    for name, row in found.items():
        table.add_row(
            WORDS[name],
            *(f"{ms:.2f}" for ms in row[3:7]),
            f"{row.error_p99_ms:.2f}",
            str(row.ticks),
            f"{row.missed} ({100.0 * row.missed_share:.3f} %)",
        )
    return table

"""What the kernel counts of a process: its time on a core, and its memory."""

from __future__ import annotations

import os
import time
from pathlib import Path

KB = 1024
CPU_CLOCK = 2
"""CPUCLOCK_SCHED of glibc: time on a core, user and system, of all threads."""


def cpu_time_s(pid: int) -> float:
    """Return the time (s) that a running process has spent on a core, to the nanosecond.

    The clock is that of clock_getcpuclockid(3). The ticks in /proc are too coarse: a process that
    mostly waits may have none in a second.

    Raises
    ------
    OSError
        If there is no such process.
    """
    return time.clock_gettime((~pid << 3) | CPU_CLOCK)


def memory_mb(pid: int) -> float:
    """Return the resident memory (MB) of a process.

    It is 0 of one that has ended, and nobody has asked how.

    Raises
    ------
    OSError
        If there is no such process.
    """
    pages = int(Path(f"/proc/{pid}/statm").read_text().split()[1])
    return round(pages * os.sysconf("SC_PAGESIZE") / KB**2, 2)


def most_memory_mb(pid: int) -> float:
    """Return the largest resident memory (MB) that a running process has had.

    Raises
    ------
    OSError
        If there is no such process.
    """
    lines = Path(f"/proc/{pid}/status").read_text().splitlines()
    return int(next(line for line in lines if line.startswith("VmHWM")).split()[1]) / 1e3

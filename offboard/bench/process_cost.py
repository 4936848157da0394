"""What the kernel counts of a process: its time on a core."""

from __future__ import annotations

import time

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

"""How a process goes before others of a busy machine; it loads nothing before it does."""

from __future__ import annotations

import os

PRIORITY = 10
"""Default priority among real-time processes: the faster loop has a higher one."""
STOP_PRIORITY = 20
"""Of who stops a robot: before all that drive it."""
NICE = -20
"""Of who may not be a real-time process: a larger share than others have."""


def ask_for_priority(priority: int = PRIORITY) -> None:
    """Go before ordinary processes where the system lets us; most let only root."""
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(priority))
    except (OSError, AttributeError):
        try:
            os.setpriority(os.PRIO_PROCESS, 0, NICE)
        except OSError:
            return

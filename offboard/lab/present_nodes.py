"""Which nodes of a robot run already, by their heartbeats on the bus."""

from __future__ import annotations

import time
from collections.abc import Callable

import lcmtypes
from koopman_lab.bus.channels import HEARTBEATS
from koopman_lab.bus.realtime import Listener

LISTEN_S = 1.2
"""More than two heartbeats, to know who is there already."""


def present_nodes(listener: Listener) -> set[str]:
    """Listen for a moment and return the nodes of this robot that speak on the bus."""
    heard: dict[str, int] = {}
    for name, channel in HEARTBEATS.items():
        listener.subscribe(channel, _pid_recorder(name, heard))
    # What waited in the queue may be from processes that have ended since.
    while listener.spin(0.0):
        pass
    heard.clear()
    end_s = time.monotonic() + LISTEN_S
    while (left_s := end_s - time.monotonic()) > 0:
        listener.spin(left_s)
    return set(heard)


def _pid_recorder(name: str, heard: dict[str, int]) -> Callable[[lcmtypes.node_status_t], None]:
    """Return a handler that keeps the process id of who speaks as ``name``."""

    def record(status: lcmtypes.node_status_t) -> None:
        heard[name] = status.pid

    return record

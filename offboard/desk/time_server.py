"""Answers the board when it asks for the desk's time."""

from __future__ import annotations

import lcmtypes
from koopman_lab.bus import channels
from koopman_lab.bus.node import Port


class TimeServer:
    """Listens to TIME_PING and speaks TIME_PONG."""

    def __init__(self, port: Port) -> None:
        self._port = port
        port.subscribe(channels.TIME_PING, self._on_ping)

    def _on_ping(self, ping: lcmtypes.time_ping_t) -> None:
        pong = lcmtypes.time_pong_t()
        pong.received_utime = self._port.now_us()
        pong.ping_utime = ping.utime
        pong.utime = self._port.now_us()
        self._port.publish(channels.TIME_PONG, pong)

"""Ties the board's time sync to the bus: pings the desk, and maps times between both clocks."""

from __future__ import annotations

import lcmtypes
from koopman_lab.bus import channels
from koopman_lab.bus.node import Port
from koopman_lab.config.schema import LabConfig
from koopman_lab.units import PPM
from onboard.time_sync import Exchange, TimeSync


class DeskTime:
    """Speaks TIME_PING, listens to TIME_PONG, and says in TIME_SYNC what it learns.

    Until the first answer both clocks count as one, and TIME_SYNC is silent.
    """

    def __init__(self, port: Port, config: LabConfig) -> None:
        self._port = port
        self._sync = TimeSync(config.clock)
        self.to_desk, self.to_board = self._sync.to_desk, self._sync.to_board
        """Return the time (us) of the one clock at a time of the other."""
        port.subscribe(channels.TIME_PONG, self._on_pong)
        port.every(config.clock.ping_rate_hz, self._on_tick)

    def _on_tick(self, tick_us: int) -> None:
        del tick_us
        message = lcmtypes.time_ping_t()
        message.utime = self._port.now_us()
        self._port.publish(channels.TIME_PING, message)

    def _on_pong(self, pong: lcmtypes.time_pong_t) -> None:
        now_us, sync = self._port.now_us(), self._sync
        is_accepted = sync.add(Exchange(pong.ping_utime, pong.received_utime, pong.utime, now_us))
        error_us = sync.error_us(now_us)
        if not is_accepted or error_us is None:
            return
        message = lcmtypes.time_sync_t()
        message.utime = sync.to_desk(now_us)
        message.offset_us, message.error_us = sync.offset_us(now_us), error_us
        message.round_trip_us = sync.round_trip_us
        message.drift_ppm, message.drift_error_ppm = sync.drift / PPM, sync.drift_error / PPM
        message.exchanges, message.restarts = sync.exchanges, sync.restarts
        self._port.publish(channels.TIME_SYNC, message)

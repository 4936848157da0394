"""Writes every logged channel into a standard LCM event log."""

from __future__ import annotations

from pathlib import Path

import lcmtypes
from koopman_lab.bus import channels
from koopman_lab.bus.node import Port
from koopman_lab.config.schema import LabConfig
from koopman_lab.errors import LogError
from koopman_lab.eventlog.logwriter import RotatingLogWriter

FAREWELLS = 3
"""A radio or a full buffer may lose a message."""
KEEP_RATE_HZ = 10.0
"""Ending the process by force, or a power failure, costs at most two such periods of data, and a
file that vanishes one."""


class LoggerNode:
    """Listens to every logged channel of the table; speaks LOGGER_STATUS.

    Parameters
    ----------
    config
        The lab; names the robot whose channels are logged.
    path
        The log to write; it must not exist yet.
    resume
        Go on behind the files of a log that is there.

    Raises
    ------
    LogError
        If the file cannot be made.
    """

    name = "logger"

    def __init__(self, config: LabConfig, path: Path, *, resume: bool = False) -> None:
        self._heartbeat_rate_hz = config.bus.heartbeat_rate_hz
        self._mocap_name = channels.MOCAP_POSE.name(config.robot.name)
        self._writer = RotatingLogWriter(path, config.logger.largest_file_bytes, resume=resume)
        self._events = 0
        self._bytes = 0

    def attach(self, port: Port) -> None:
        """Register channels and timers."""
        self._port = port
        for channel in channels.all_channels():
            if channel.logged:
                port.subscribe_raw(channel, self._on_message)
        # In lockstep nobody pulls a plug, and many virtual seconds go into a real one.
        self._keep = self._writer.flush if port.virtual else self._writer.sync
        port.every(KEEP_RATE_HZ, self._on_keep)
        port.every(self._heartbeat_rate_hz, self._on_heartbeat)

    def close(self) -> None:
        """Flush and close the log."""
        self._writer.close()

    def _on_message(self, name: str, data: bytes, arrived_us: int) -> None:
        try:
            self._bytes += self._writer.write(name, data, arrived_us)
        except LogError:
            self._give_up(arrived_us)
            raise
        self._events += 1

    def _on_keep(self, tick_us: int) -> None:
        try:
            self._writer.check()
            self._keep()
        except LogError:
            self._give_up(tick_us)
            raise

    def _give_up(self, now_us: int) -> None:
        """Say that nothing more is written down, so that the robot stops before it is missed."""
        self._bytes = lcmtypes.logger_status_t.NOT_WRITING
        for _ in range(FAREWELLS):
            self._on_heartbeat(now_us)

    def _on_heartbeat(self, tick_us: int) -> None:
        status = lcmtypes.logger_status_t()
        status.utime = tick_us
        status.events, status.bytes = self._events, self._bytes
        lost = self._port.lost_messages()
        status.lost_messages = sum(lost.values())
        status.mocap_lost_messages = lost.get(self._mocap_name, 0)
        self._port.publish(channels.LOGGER_STATUS, status)

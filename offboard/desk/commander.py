"""What a node that drives the robot says: commands, and the session's information."""

from __future__ import annotations

from collections.abc import Sequence
from importlib.metadata import version

import lcmtypes
from koopman_lab.bus import channel, channels
from koopman_lab.bus.commanders import commander_number
from koopman_lab.bus.node import Port
from koopman_lab.config.load import dump_config
from koopman_lab.config.schema import LabConfig
from koopman_lab.robots.table import robot_type
from offboard.desk.refused_commands import RefusedCommands
from offboard.desk.time_server import TimeServer

ONBOARD_TIMEOUT_S = 1.0
"""Ten of its status messages."""


class Commands:
    """Sends inputs as the message by which the robot's type is commanded.

    As long as the motor loop does not say that this commander holds the robot, each command
    offers to begin a sequence; that also takes the robot again after its watchdog has stopped it.

    Who commands also tells the board the time: it is this clock that stamps the commands, and by
    which their age is judged. The logger could not, as it only receives and stores.

    Parameters
    ----------
    port, config
        Of the node.
    node
        Its name; its row in the table of processes has a role.

    Raises
    ------
    LabStateError
        If the robot's type has no such message.
    PluginError
        If its channel carries another one.
    """

    def __init__(self, port: Port, config: LabConfig, node: str) -> None:
        self._port = port
        self.number = commander_number(node, port.process)
        """Of this commander, in commands and in what the motor loop says of them."""
        TimeServer(port)
        robot = robot_type(config.robot.kind)
        self._channel = channels.command_channel(robot)
        self._message = robot.commanded()
        self._no_input = (0.0,) * robot.input_dim
        self._holds = False
        self._sent = 0
        self.refused = RefusedCommands(self.number, config.commander.refused_limit_s)
        """Whether the motor loop takes what is sent."""
        port.subscribe(channels.ONBOARD_STATUS, self._on_onboard)

    def send(self, u: Sequence[float], utime: int) -> None:
        """Send an input (m,) in the units of the robot's inputs."""
        intent = lcmtypes.velocity_command_t.CONTINUE
        if not self._holds:
            intent = lcmtypes.velocity_command_t.BEGIN
        self._send(u, utime, intent)

    def release_if_held(self, utime: int) -> None:
        """Bring the robot to rest and give it up, as long as the motor loop says it is held."""
        if self._holds:
            self.release(utime)

    def release(self, utime: int) -> None:
        """Bring the robot to rest and give it up."""
        self._send(self._no_input, utime, lcmtypes.velocity_command_t.RELEASE)

    def _on_onboard(self, status: lcmtypes.onboard_status_t) -> None:
        self._holds = status.commander == self.number
        self.refused.see(status, self._sent, self._port.now_us())

    def _send(self, u: Sequence[float], utime: int, intent: int) -> None:
        message = self._channel.type()
        message.utime, message.commander, message.intent = utime, self.number, intent
        self._message.encode(message, u)
        self._sent += 1
        self._port.publish(self._channel, message)


class SessionInfo:
    """Repeats what is being done and with which configuration, so that a log explains itself."""

    def __init__(self, port: Port, config: LabConfig, activity: str) -> None:
        self._port = port
        self._message = lcmtypes.session_info_t()
        self._message.activity = activity
        self._message.config_yaml = dump_config(config)
        self._message.version = version("koopman-lab")
        port.every(channel.INFO_RATE_HZ, self._send)

    def _send(self, tick_us: int) -> None:
        self._message.utime = tick_us
        self._port.publish(channels.SESSION_INFO, self._message)

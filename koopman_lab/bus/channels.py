"""The one table of LCM channels: what each carries, and who publishes it how often."""

from __future__ import annotations

import contextlib
import struct
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import lcmtypes
from koopman_lab.bus.channel import COMMANDER, Channel
from koopman_lab.bus.processes import PROCESSES, process
from koopman_lab.errors import BusError, PluginError, UnknownChannelError
from koopman_lab.robots.command_message import CommandMessage
from koopman_lab.robots.dynamic import DYNAMIC
from koopman_lab.robots.kinematic import KINEMATIC
from koopman_lab.robots.robot_type import RobotType
from koopman_lab.robots.table import ROBOTS

if TYPE_CHECKING:
    pass


def _command_channel_of(command: CommandMessage) -> Channel[Any]:
    return Channel(command.suffix, command.type, "control", COMMANDER, protection="always")


def _engages_a_stop(data: bytes) -> bool:
    """Return whether a message of ESTOP stops a robot; that also a switch without the key may."""
    # Only where there is a key, and then rarely.
    from koopman_lab.eventlog.older_layouts import in_present_layout

    try:
        return lcmtypes.estop_t.decode(in_present_layout(data)).engaged
    except (ValueError, struct.error):
        return False


# Protected where the lab has a key is what moves a robot, lets it go, or permits either. Of cameras
# and encoders only what was signed once: firmware and bridges of others cannot.
MOCAP_POSE = Channel(
    "MOCAP_POSE", lcmtypes.mocap_pose_t, "mocap", "plant", protection="when signed"
)
ENCODER = Channel(
    "ENCODER",
    lcmtypes.encoder_t,
    "motor",
    "plant",
    wired=True,
    replayed="stream",
    protection="when signed",
)
MOTOR_CMD = Channel(
    "MOTOR_CMD",
    lcmtypes.motor_command_t,
    "motor",
    "onboard",
    wired=True,
    replayed="stream",
    protection="always",
)
WHEEL_STATE = Channel(
    "WHEEL_STATE", lcmtypes.wheel_state_t, "wheel_state", "onboard", protection="always"
)
ONBOARD_STATUS = Channel(
    "ONBOARD_STATUS", lcmtypes.onboard_status_t, "status", "onboard", protection="always"
)
VELOCITY_CMD = _command_channel_of(KINEMATIC.commanded())
ACCELERATION_CMD = _command_channel_of(DYNAMIC.commanded())
ESTOP = Channel(
    "ESTOP",
    lcmtypes.estop_t,
    "event",
    "operator",
    protection="always",
    open_to_all=_engages_a_stop,
)
PLANT_RESET = Channel(
    "PLANT_RESET",
    lcmtypes.plant_reset_t,
    "event",
    "operator",
    replayed="order",
    protection="always",
)
GOAL = Channel("GOAL", lcmtypes.goal_t, "event", "operator", protection="always")
FAULT = Channel(
    "FAULT",
    lcmtypes.fault_t,
    "event",
    "operator",
    wired=True,
    replayed="order",
    protection="always",
)
PLANT_TRUTH = Channel("PLANT_TRUTH", lcmtypes.plant_truth_t, "motor", "plant")
SAMPLER_STATE = Channel("SAMPLER_STATE", lcmtypes.sampler_state_t, "control", "sampler")
REFERENCE_STATE = Channel("REFERENCE_STATE", lcmtypes.reference_state_t, "control", "reference")
MPC_STATE = Channel("MPC_STATE", lcmtypes.mpc_state_t, "control", "controller")
INTERLOCK = Channel("INTERLOCK", lcmtypes.interlock_t, "event", COMMANDER)
LOGGER_STATUS = Channel(
    "LOGGER_STATUS", lcmtypes.logger_status_t, "heartbeat", "logger", protection="always"
)
TIME_PING = Channel("TIME_PING", lcmtypes.time_ping_t, "ping", "onboard")
TIME_PONG = Channel("TIME_PONG", lcmtypes.time_pong_t, "ping", "commander", protection="always")
TIME_SYNC = Channel("TIME_SYNC", lcmtypes.time_sync_t, "ping", "onboard")
SESSION_INFO = Channel("SESSION_INFO", lcmtypes.session_info_t, "info", "commander")
# Not logged: several commands may speak on it, so that its numbers tell of no loss.
PROCESS = Channel(
    "PROCESS", lcmtypes.process_t, "event", "supervisor", logged=False, protection="always"
)

# Of a person's own `klab replay`, not of the robot; not logged, as no log replays its replay.
REPLAY_STATE = Channel("REPLAY_STATE", lcmtypes.replay_state_t, "event", "operator", logged=False)
REPLAY_CONTROL = Channel(
    "REPLAY_CONTROL",
    lcmtypes.replay_control_t,
    "event",
    "operator",
    logged=False,
    replayed="order",
)


class _Heartbeats(Mapping[str, Channel[lcmtypes.node_status_t]]):
    """Maps a node's name to its heartbeat channel, also of nodes that other packages add."""

    def __init__(self) -> None:
        rows = filter(None, map(PROCESSES.builtin_row, PROCESSES.builtin_names()))
        self._builtin = {row.name: _heartbeat(row.name) for row in rows if row.factory}

    def __getitem__(self, node: str) -> Channel[lcmtypes.node_status_t]:
        channel = self._builtin.get(node)
        if channel is None and (node in PROCESSES.builtin_names() or node not in PROCESSES):
            raise KeyError(node)
        return channel or _heartbeat(node)

    def __iter__(self) -> Iterator[str]:
        return iter((*self._builtin, *self.plugin_nodes()))

    def __len__(self) -> int:
        return len(self._builtin) + len(self.plugin_nodes())

    def builtin(self) -> list[Channel[lcmtypes.node_status_t]]:
        """Return those of our own nodes."""
        return list(self._builtin.values())

    def plugin_nodes(self) -> list[str]:
        """Return the nodes that other packages add."""
        return [name for name in PROCESSES.names() if name not in PROCESSES.builtin_names()]


def _heartbeat(node: str) -> Channel[lcmtypes.node_status_t]:
    return Channel(f"{node.upper()}_HEARTBEAT", lcmtypes.node_status_t, "heartbeat", node)


HEARTBEATS = _Heartbeats()

CHANNELS: tuple[Channel[Any], ...] = (
    MOCAP_POSE,
    ENCODER,
    MOTOR_CMD,
    WHEEL_STATE,
    ONBOARD_STATUS,
    VELOCITY_CMD,
    ACCELERATION_CMD,
    ESTOP,
    PLANT_RESET,
    GOAL,
    FAULT,
    PLANT_TRUTH,
    SAMPLER_STATE,
    REFERENCE_STATE,
    MPC_STATE,
    INTERLOCK,
    LOGGER_STATUS,
    TIME_PING,
    TIME_PONG,
    TIME_SYNC,
    SESSION_INFO,
    PROCESS,
    REPLAY_STATE,
    REPLAY_CONTROL,
    *HEARTBEATS.builtin(),
)
"""The channels of our own; :func:`all_channels` has those of other packages as well."""


def all_channels() -> tuple[Channel[Any], ...]:
    """Return our own channels and those of nodes and robots that other packages add.

    What :func:`channel_faults` names is left out, and what :func:`command_channel` refuses.
    """
    channels = {channel.suffix: channel for channel in CHANNELS}
    for channel in (*_plugin_channels(), *_robot_command_channels()):
        channels.setdefault(channel.suffix, channel)
    return tuple(channels.values())


def channel_faults() -> dict[str, str]:
    """Return by node of other packages what is wrong with its channels."""
    publishers = {channel.suffix: channel.publisher for channel in CHANNELS}
    faults = {}
    for channel in _plugin_channels():
        owner = publishers.setdefault(channel.suffix, channel.publisher)
        if owner != channel.publisher:
            faults[channel.publisher] = (
                f"{PROCESSES.origin(channel.publisher)}: its channel {channel.suffix} is that of "
                f"the {owner} already and not heard; ask its author for another name"
            )
    return faults


def _plugin_channels() -> Iterator[Channel[Any]]:
    """Give the channels of nodes that other packages add."""
    for node in HEARTBEATS.plugin_nodes():
        yield HEARTBEATS[node]
        for channel in process(node).channels:
            yield replace(channel, publisher=node)


def _robot_command_channels() -> Iterator[Channel[Any]]:
    """Give the channels that kinds of robots are commanded on."""
    for robot in ROBOTS:
        if robot.command is not None:
            yield _command_channel_of(robot.command)


def command_channel(robot: RobotType) -> Channel[Any]:
    """Return the channel that a kind of robot is commanded on.

    Raises
    ------
    LabStateError
        If nobody can command it.
    PluginError
        If the channel carries another message already.
    """
    command = robot.commanded()
    for channel in all_channels():
        if channel.suffix == command.suffix and channel.type is not command.type:
            raise PluginError(
                f"robot {robot.name!r}: the channel {command.suffix} carries "
                f"{channel.type.__name__} already, not {command.type.__name__}; its description "
                "needs another suffix"
            )
    return _command_channel_of(command)


def wheel_command_channels() -> tuple[Channel[Any], ...]:
    """Return the channels on which robots on two driven wheels are commanded, whatever the kind."""
    commands = [robot.command for robot in ROBOTS if robot.drive is not None]
    suffixes = {command.suffix for command in commands if command is not None}
    return tuple(channel for channel in all_channels() if channel.suffix in suffixes)


def split_name(name: str) -> tuple[str, Channel[Any]]:
    """Split a channel name on the bus into the robot's name and the row of the table.

    Raises
    ------
    UnknownChannelError
        If no row ends the name.
    """
    # Those of other packages only where needed: monitors ask this of every message.
    split = _split(name, CHANNELS) or _split(name, all_channels())
    if split is not None:
        return split
    raise UnknownChannelError(
        f"channel {name!r} is not of this lab; names are ROBOT_SUFFIX with one of: "
        f"{_suffixes(all_channels())}"
    )


def _split(name: str, table: Iterable[Channel[Any]]) -> tuple[str, Channel[Any]] | None:
    for channel in table:
        robot_name, separator, rest = name.rpartition(f"_{channel.suffix}")
        if separator and not rest and robot_name:
            return robot_name, channel
    return None


def robots_of(names: Iterable[str]) -> list[str]:
    """Return the robots that speak on some of these channels, in alphabetical order.

    Channels that are none of this lab say nothing.
    """
    robots = set()
    for name in names:
        with contextlib.suppress(BusError):
            robots.add(split_name(name)[0])
    return sorted(robots)


def _suffixes(channels: Iterable[Channel[Any]]) -> str:
    return ", ".join(c.suffix for c in channels)

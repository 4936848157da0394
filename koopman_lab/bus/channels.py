"""The one table of channels; nobody else spells a channel."""

from __future__ import annotations

import contextlib
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Generic, Literal, Protocol, TypeVar

import lcmtypes
from koopman_lab.bus.processes import PROCESSES, process
from koopman_lab.bus.replay_guard import Replayed
from koopman_lab.errors import BusError, PluginError
from koopman_lab.robots.command_message import CommandMessage
from koopman_lab.robots.dynamic import DYNAMIC
from koopman_lab.robots.kinematic import KINEMATIC
from koopman_lab.robots.robot_type import RobotType
from koopman_lab.robots.table import ROBOTS

if TYPE_CHECKING:
    from koopman_lab.config.schema import LabConfig


class Message(Protocol):
    """What every generated LCM type of this project offers."""

    utime: int
    sequence: int

    def encode(self) -> bytes:
        """Return the wire form: fingerprint, then the fields in big-endian order."""

    @staticmethod
    def decode(data: bytes) -> Any:
        """Return the message; ValueError or struct.error if ``data`` is none of this type."""


M = TypeVar("M", bound=Message)

Rate = Literal[
    "mocap", "motor", "wheel_state", "status", "control", "heartbeat", "info", "ping", "event"
]
COMMANDER = "commander"
"""Whichever node commands the robot: they all speak on the same channels, one at a time."""

OPERATOR = "operator"
"""A person."""

SUPERVISOR = "supervisor"
"""Each command that has started processes."""

INFO_RATE_HZ = 1.0
"""What a log needs to explain itself is four kilobytes; once a second is soon enough."""

ABOARD = "onboard"
"""The node on the robot's board: between it and all others lie the radio and a second clock."""


@dataclass(frozen=True)
class Channel(Generic[M]):
    """One row of the table.

    Attributes
    ----------
    suffix
        Its name behind that of the robot.
    type
        Of its messages, from lcm-gen.
    rate
        How often it speaks: as a part of the configuration says, in Hz, or only on events.
    publisher
        The node that speaks on it, :data:`COMMANDER`, :data:`OPERATOR` or :data:`SUPERVISOR`.
    logged
        Whether the logger writes it down.
    wired
        Never crosses the radio: the board's own hardware, or what goes wrong with the radio.
    replayed
        What keeps a log that is sent again off those who act on the channel.
    """

    suffix: str
    type: type[M]
    rate: Rate | float
    publisher: str
    logged: bool = True
    wired: bool = False
    replayed: Replayed = "passes"

    def name(self, robot_name: str) -> str:
        """Return the channel name on the bus, for example ``R1_MOCAP_POSE``."""
        return f"{robot_name}_{self.suffix}"

    @property
    def is_command(self) -> bool:
        """Return whether it carries inputs to a robot, whatever its kind."""
        return self.rate == "control" and self.publisher == COMMANDER

    def rate_hz(self, config: LabConfig) -> float | None:
        """Return the nominal rate, or None for a channel that speaks only on events."""
        if isinstance(self.rate, (int, float)):
            return self.rate
        return {
            "mocap": config.mocap.rate_hz,
            "motor": config.motor_loop.rate_hz,
            "wheel_state": config.motor_loop.wheel_state_rate_hz,
            "status": config.motor_loop.status_rate_hz,
            "control": 1.0 / config.controller.dt_s,
            "heartbeat": config.bus.heartbeat_rate_hz,
            "info": INFO_RATE_HZ,
            "ping": config.clock.ping_rate_hz,
            "event": None,
        }[self.rate]


def _carrying(command: CommandMessage) -> Channel[Any]:
    return Channel(command.suffix, command.type, "control", COMMANDER)


MOCAP_POSE = Channel("MOCAP_POSE", lcmtypes.mocap_pose_t, "mocap", "plant")
ENCODER = Channel("ENCODER", lcmtypes.encoder_t, "motor", "plant", wired=True, replayed="stream")
MOTOR_CMD = Channel(
    "MOTOR_CMD", lcmtypes.motor_command_t, "motor", "onboard", wired=True, replayed="stream"
)
WHEEL_STATE = Channel("WHEEL_STATE", lcmtypes.wheel_state_t, "wheel_state", "onboard")
ONBOARD_STATUS = Channel("ONBOARD_STATUS", lcmtypes.onboard_status_t, "status", "onboard")
VELOCITY_CMD = _carrying(KINEMATIC.commanded())
ACCELERATION_CMD = _carrying(DYNAMIC.commanded())
ESTOP = Channel("ESTOP", lcmtypes.estop_t, "event", "operator")
PLANT_RESET = Channel("PLANT_RESET", lcmtypes.plant_reset_t, "event", "operator", replayed="order")
GOAL = Channel("GOAL", lcmtypes.goal_t, "event", "operator")
FAULT = Channel("FAULT", lcmtypes.fault_t, "event", "operator", wired=True, replayed="order")
PLANT_TRUTH = Channel("PLANT_TRUTH", lcmtypes.plant_truth_t, "motor", "plant")
SAMPLER_STATE = Channel("SAMPLER_STATE", lcmtypes.sampler_state_t, "control", "sampler")
REFERENCE_STATE = Channel("REFERENCE_STATE", lcmtypes.reference_state_t, "control", "reference")
MPC_STATE = Channel("MPC_STATE", lcmtypes.mpc_state_t, "control", "controller")
LOGGER_STATUS = Channel("LOGGER_STATUS", lcmtypes.logger_status_t, "heartbeat", "logger")
TIME_PING = Channel("TIME_PING", lcmtypes.time_ping_t, "ping", "onboard")
TIME_PONG = Channel("TIME_PONG", lcmtypes.time_pong_t, "ping", "commander")
TIME_SYNC = Channel("TIME_SYNC", lcmtypes.time_sync_t, "ping", "onboard")
SESSION_INFO = Channel("SESSION_INFO", lcmtypes.session_info_t, "info", "commander")
# Not logged: several commands may speak on it, so that its numbers tell of no loss.
PROCESS = Channel("PROCESS", lcmtypes.process_t, "event", "supervisor", logged=False)


class _Heartbeats(Mapping[str, Channel[lcmtypes.node_status_t]]):
    """By node: all nodes have one, also those that other packages add."""

    def __init__(self) -> None:
        rows = filter(None, map(PROCESSES.own, PROCESSES.own_names()))
        self._own = {row.name: _heartbeat(row.name) for row in rows if row.factory}

    def __getitem__(self, node: str) -> Channel[lcmtypes.node_status_t]:
        own = self._own.get(node)
        if own is None and (node in PROCESSES.own_names() or node not in PROCESSES):
            raise KeyError(node)
        return own or _heartbeat(node)

    def __iter__(self) -> Iterator[str]:
        return iter((*self._own, *self.others()))

    def __len__(self) -> int:
        return len(self._own) + len(self.others())

    def own(self) -> list[Channel[lcmtypes.node_status_t]]:
        """Return those of our own nodes."""
        return list(self._own.values())

    def others(self) -> list[str]:
        """Return the nodes that other packages add."""
        return [name for name in PROCESSES.names() if name not in PROCESSES.own_names()]


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
    LOGGER_STATUS,
    TIME_PING,
    TIME_PONG,
    TIME_SYNC,
    SESSION_INFO,
    PROCESS,
    *HEARTBEATS.own(),
)
"""Our own; :func:`all_channels` has those of other packages as well."""


def all_channels() -> tuple[Channel[Any], ...]:
    """Return our own channels and those of nodes and robots that other packages add.

    What :func:`channel_faults` names is left out, and what :func:`command_channel` refuses.
    """
    channels = {channel.suffix: channel for channel in CHANNELS}
    for channel in (*_of_other_nodes(), *_of_robots()):
        channels.setdefault(channel.suffix, channel)
    return tuple(channels.values())


def channel_faults() -> dict[str, str]:
    """Return by node of other packages what is wrong with its channels."""
    taken = {channel.suffix: channel.publisher for channel in CHANNELS}
    faults = {}
    for channel in _of_other_nodes():
        owner = taken.setdefault(channel.suffix, channel.publisher)
        if owner != channel.publisher:
            faults[channel.publisher] = (
                f"{PROCESSES.origin(channel.publisher)}: its channel {channel.suffix} is that of "
                f"the {owner} already and not heard; ask its author for another name"
            )
    return faults


def _of_other_nodes() -> Iterator[Channel[Any]]:
    """Give the channels of nodes that other packages add."""
    for node in HEARTBEATS.others():
        yield HEARTBEATS[node]
        for channel in process(node).channels:
            yield replace(channel, publisher=node)


def _of_robots() -> Iterator[Channel[Any]]:
    """Give the channels that kinds of robots are commanded on."""
    for robot in ROBOTS:
        if robot.command is not None:
            yield _carrying(robot.command)


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
    return _carrying(command)


def wheel_command_channels() -> tuple[Channel[Any], ...]:
    """Return the channels on which robots on two driven wheels are commanded, whatever the kind."""
    commands = [robot.command for robot in ROBOTS if robot.drive is not None]
    suffixes = {command.suffix for command in commands if command is not None}
    return tuple(channel for channel in all_channels() if channel.suffix in suffixes)


def split_name(name: str) -> tuple[str, Channel[Any]]:
    """Split a channel name on the bus into the robot's name and the row of the table.

    Raises
    ------
    BusError
        If no row ends the name.
    """
    # Those of other packages only where needed: monitors ask this of every message.
    split = _split(name, CHANNELS) or _split(name, all_channels())
    if split is not None:
        return split
    raise BusError(
        f"channel {name!r} is not of this lab; names are ROBOT_SUFFIX with one of: "
        f"{_listing(all_channels())}"
    )


def _split(name: str, table: Iterable[Channel[Any]]) -> tuple[str, Channel[Any]] | None:
    for channel in table:
        robot_name, joint, rest = name.rpartition(f"_{channel.suffix}")
        if joint and not rest and robot_name:
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


def _listing(channels: Iterable[Channel[Any]]) -> str:
    return ", ".join(c.suffix for c in channels)

"""The one table of channels; nobody else spells a channel."""

from __future__ import annotations

import contextlib
from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Generic, Literal, Protocol, TypeVar

import lcmtypes
from koopman_lab.bus.replay_guard import Replayed
from koopman_lab.errors import BusError

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
Owner = Literal[
    "plant",
    "onboard",
    "logger",
    "sampler",
    "controller",
    "reference",
    "operator",
    "commander",
    "supervisor",
]
"""Who publishes; ``commander`` is whichever of :data:`DRIVERS` drives the robot, and
``supervisor`` each command that has started processes."""

DRIVERS: tuple[Owner, ...] = ("sampler", "controller", "reference")
"""Nodes that command the robot. They speak on the same channels, one of them at a time."""

OPERATOR: Owner = "operator"
"""A person."""

INFO_RATE_HZ = 1.0
"""What a log needs to explain itself is four kilobytes; once a second is soon enough."""

ABOARD: Owner = "onboard"
"""The node on the robot's board: between it and all others lie the radio and a second clock."""


@dataclass(frozen=True)
class Channel(Generic[M]):
    """One row of the table."""

    suffix: str
    type: type[M]
    rate: Rate
    publisher: Owner
    logged: bool = True
    wired: bool = False
    """Never crosses the radio: the board's own hardware, or what goes wrong with the radio."""
    replayed: Replayed = "passes"
    """What keeps a log that is sent again off those who act on the channel."""

    def name(self, robot_name: str) -> str:
        """Return the channel name on the bus, for example ``R1_MOCAP_POSE``."""
        return f"{robot_name}_{self.suffix}"

    def rate_hz(self, config: LabConfig) -> float | None:
        """Return the nominal rate, or None for a channel that speaks only on events."""
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


MOCAP_POSE = Channel("MOCAP_POSE", lcmtypes.mocap_pose_t, "mocap", "plant")
ENCODER = Channel("ENCODER", lcmtypes.encoder_t, "motor", "plant", wired=True, replayed="stream")
MOTOR_CMD = Channel(
    "MOTOR_CMD", lcmtypes.motor_command_t, "motor", "onboard", wired=True, replayed="stream"
)
WHEEL_STATE = Channel("WHEEL_STATE", lcmtypes.wheel_state_t, "wheel_state", "onboard")
ONBOARD_STATUS = Channel("ONBOARD_STATUS", lcmtypes.onboard_status_t, "status", "onboard")
VELOCITY_CMD = Channel("VELOCITY_CMD", lcmtypes.velocity_command_t, "control", "commander")
ACCELERATION_CMD = Channel(
    "ACCELERATION_CMD", lcmtypes.acceleration_command_t, "control", "commander"
)
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
HEARTBEATS: dict[str, Channel[lcmtypes.node_status_t]] = {
    node: Channel(f"{node.upper()}_HEARTBEAT", lcmtypes.node_status_t, "heartbeat", node)
    for node in ("plant", "onboard", "logger", *DRIVERS)
}

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
    *HEARTBEATS.values(),
)


def split_name(name: str) -> tuple[str, Channel[Any]]:
    """Split a channel name on the bus into the robot's name and the row of the table.

    Raises
    ------
    BusError
        If no row ends the name.
    """
    for channel in CHANNELS:
        robot_name, found, rest = name.rpartition(f"_{channel.suffix}")
        if found and not rest and robot_name:
            return robot_name, channel
    raise BusError(
        f"channel {name!r} is not of this lab; names are ROBOT_SUFFIX with one of: "
        f"{_listing(CHANNELS)}"
    )


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

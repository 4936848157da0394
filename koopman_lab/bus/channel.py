"""One channel of the bus: its name, its messages, their rate, and who publishes it.

The channels that there are stand in `koopman_lab.bus.channels`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Generic, Literal, Protocol, TypeVar

from koopman_lab.bus.processes import PROCESSES, Stop, process
from koopman_lab.bus.replay_guard import Replayed

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


Protection = Literal["never", "when signed", "always"]
"""Whose messages count where the lab has a key: everybody's; everybody's until a holder of the key
speaks, then only those with its tag; only those with its tag."""


COMMANDER = "commander"
"""Whichever node commands the robot: they all speak on the same channels, one at a time."""


OPERATOR = "operator"
"""A person, who publishes through a command or the page."""


SUPERVISOR = "supervisor"
"""A command that has started processes and watches them."""


ABOARD = "onboard"
"""The node on the robot's board: between it and all others lie the radio and a second clock."""


INFO_RATE_HZ = 1.0
"""What a log needs to explain itself is four kilobytes; once a second is soon enough."""


@dataclass(frozen=True)
class Channel(Generic[M]):
    """One row of the table of channels.

    Attributes
    ----------
    suffix
        Its name on the bus, behind the robot's name.
    type
        The class of its messages, from lcm-gen.
    rate
        How often messages come: as a part of the configuration says, in Hz, or only on events.
    publisher
        The node that speaks on it, :data:`COMMANDER`, :data:`OPERATOR` or :data:`SUPERVISOR`.
    logged
        Whether the logger writes it down.
    wired
        Whether it never crosses the radio: the board's hardware and its faults need none.
    replayed
        What becomes of messages of a log that is sent again, where somebody acts on the channel.
    protection
        Whose messages count where the lab has a key.
    open_to_all
        Returns of an encoded message of a protected channel whether anybody may send it.
    """

    suffix: str
    type: type[M]
    rate: Rate | float
    publisher: str
    logged: bool = True
    wired: bool = False
    replayed: Replayed = "passes"
    protection: Protection = "never"
    open_to_all: Callable[[bytes], bool] | None = None

    def name(self, robot_name: str) -> str:
        """Return the channel name on the bus, for example ``R1_MOCAP_POSE``."""
        return f"{robot_name}_{self.suffix}"

    @property
    def is_command(self) -> bool:
        """Return whether it carries inputs to a robot, whatever its kind."""
        return self.rate == "control" and self.publisher == COMMANDER

    @property
    def has_one_publisher(self) -> bool:
        """Return whether one program at a time may speak on it for a robot.

        So it is with what comes from its hardware, its cameras and its board; commanders, persons
        and loggers may be several.
        """
        hardware = (Stop.BOARD, Stop.HARDWARE)
        return self.publisher in PROCESSES and process(self.publisher).stops in hardware

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

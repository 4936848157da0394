"""How a kind of robot is commanded: which channel, which message, which of its fields."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class CommandMessage:
    """The message that carries an input to the robot.

    Attributes
    ----------
    suffix
        The channel's suffix, such as ``VELOCITY_CMD``. Kinds that share it share the message.
    type
        Generated from a struct in LCM's language. It begins with ``utime``, ``sequence``,
        ``commander`` and ``intent``, which mean what they do in ``velocity_command_t``.
    fields
        Fields that hold the input, one a component, in the order of the robot's inputs.
    """

    suffix: str
    type: type[Any]
    fields: tuple[str, ...]

    def encode(self, message: Any, u: Sequence[float]) -> None:
        """Write an input (m,) into a message."""
        for field, value in zip(self.fields, u, strict=True):
            setattr(message, field, value)

    def decode(self, message: Any) -> tuple[float, ...]:
        """Return the input (m,) that a message holds."""
        return tuple([getattr(message, field) for field in self.fields])

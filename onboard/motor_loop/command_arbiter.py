"""Who may command the robot, and which commands count."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from enum import IntEnum
from typing import Literal, NamedTuple

from koopman_lab.bus.age import is_current
from koopman_lab.bus.commanders import NOBODY
from koopman_lab.config.schema import LabConfig
from koopman_lab.robots.table import robot_type
from koopman_lab.units import US_PER_S

ROUNDING = 1e-9
Refusal = Literal["value", "stale", "order", "commander", "type", "stopped"]


class Intent(IntEnum):
    """What a command intends; the numbers are those of the command messages."""

    CONTINUE = 0
    BEGIN = 1
    RELEASE = 2


class Command(NamedTuple):
    """A command as it was received: ``u1`` and ``u2`` in the units of the robot's inputs."""

    utime: int
    sequence: int
    commander: int
    intent: Intent
    u1: float
    u2: float


@dataclass
class Counts:
    """Commands accepted and refused since start."""

    accepted: int = 0
    refused: dict[Refusal, int] = field(
        default_factory=lambda: dict.fromkeys(
            ("value", "stale", "order", "commander", "type", "stopped"), 0
        )
    )


class CommandArbiter:
    """The first commander to begin holds the robot until it releases it or falls silent.

    Only a command with the intent to begin takes a robot that nobody holds. So a stream of
    commands that the watchdog has cut off cannot go on by itself where it would have been.

    Parameters
    ----------
    config
        Limits of commands, their lifetime, and the time of silence that loses the hold.
    """

    def __init__(self, config: LabConfig) -> None:
        limits = config.motor_loop.limits
        self.holder = NOBODY
        self.refused_last = NOBODY
        """Commander that was refused last because another one holds the robot."""
        self.counts = Counts()
        drive = robot_type(config.robot.kind).on_two_wheels()
        self._largest_u = [getattr(limits, name) for name in drive.limits]
        self._lifetime_us = round(config.motor_loop.command_lifetime_s * US_PER_S)
        self._watchdog_us = round(config.motor_loop.watchdog_s * US_PER_S)
        self._last_sequence = -1
        self._accepted_at_us = 0

    def consider(self, command: Command, now_us: int, *, ready: bool) -> Refusal | None:
        """Accept a command, or return and count why not.

        Parameters
        ----------
        command
            As it was received.
        now_us
            Onboard time, in the same clock as ``command.utime``.
        ready
            Whether a robot that nobody holds may be taken.
        """
        refusal = self._refusal(command, now_us, ready=ready)
        if refusal is not None:
            self.counts.refused[refusal] += 1
            if refusal == "commander":
                self.refused_last = command.commander
            return refusal
        self.counts.accepted += 1
        self.holder = command.commander
        self._last_sequence = command.sequence
        self._accepted_at_us = now_us
        return None

    def refuse(self, reason: Refusal) -> Refusal:
        """Count a command that does not come so far as to be considered."""
        self.counts.refused[reason] += 1
        return reason

    def is_silent(self, now_us: int) -> bool:
        """Return whether the holder's last accepted command is too old.

        One that seems to lie ahead tells of a clock that was set back: its age is not known.
        """
        return self.holder != NOBODY and not is_current(
            self._accepted_at_us, now_us, self._watchdog_us
        )

    def revoke(self) -> None:
        """Take the robot from whoever holds it."""
        self.holder = NOBODY

    def _refusal(self, command: Command, now_us: int, *, ready: bool) -> Refusal | None:
        for u, largest in zip((command.u1, command.u2), self._largest_u, strict=True):
            if not math.isfinite(u) or abs(u) > largest * (1.0 + ROUNDING):
                return "value"
        if not is_current(command.utime, now_us, self._lifetime_us):
            return "stale"
        if self.holder == NOBODY:
            begins = command.intent is Intent.BEGIN and command.commander != NOBODY
            return None if ready and begins else "order"
        if command.commander != self.holder:
            return "commander"
        return "order" if command.sequence <= self._last_sequence else None

"""What the sampler sees and commands in a step, and how far its session has come."""

from __future__ import annotations

from enum import IntEnum
from typing import NamedTuple

from koopman_lab.geometry.planar import Pose, Velocity
from offboard.desk.interlock import Interlock


class Phase(IntEnum):
    """Of the session; the numbers are those of ``sampler_state_t``."""

    WAIT = 0
    ROTATE_TO_TARGET = 1
    DRIVE = 2
    ROTATE_TO_HEADING = 3
    SETTLE = 4
    LAUNCH = 5
    BASIS = 6
    BRAKE = 7
    DONE = 8


class Observation(NamedTuple):
    """What the sampler sees in a step.

    ``pose`` is None while tracking is lost; ``setpoint`` is what the motor loop reports;
    ``interlock`` is why the robot must not be driven, None if it may be.
    """

    pose: Pose | None
    setpoint: Velocity | None
    interlock: Interlock | None


class Action(NamedTuple):
    """Phase and input of one control interval."""

    phase: Phase
    segment: int
    basis_index: int
    u: tuple[float, float]


class Progress(NamedTuple):
    """How far a session has come.

    ``done`` complete segments, ``runs`` begun, ``frames`` of runs, ``redraws`` in all.
    """

    done: int = 0
    runs: int = 0
    frames: int = 0
    redraws: int = 0


NOTHING = Progress()

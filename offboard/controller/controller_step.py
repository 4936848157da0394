"""What the controller sees in a step, and what it decides."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from offboard.desk.interlock import Interlock
from offboard.desk.measurements import Frame, WheelSpeeds


class State(IntEnum):
    """Of the controller; the numbers are those of ``mpc_state_t``."""

    WAIT = 0
    DRIVING = 1
    PARKED = 2
    TIME_LIMIT = 3
    FAILED = 4
    PAUSED = 5


@dataclass(frozen=True)
class Inputs:
    """What a step sees.

    Attributes
    ----------
    frames
        Camera frames since the last step that can be believed, in order of arrival.
    wheels
        The newest wheel odometry, None if there is none yet.
    interlock
        Why the robot must not be driven, None if it may.
    delay_s
        From this step until a command sent in it acts.
    """

    frames: tuple[Frame, ...]
    wheels: WheelSpeeds | None
    interlock: Interlock | None
    delay_s: float = 0.0


@dataclass(frozen=True)
class Outputs:
    """What a step decides.

    Attributes
    ----------
    state
        Of the controller.
    holds
        Whether to hold the robot by commands. Otherwise it is given up, and the motor loop brings
        it to rest: for that it needs neither cameras nor this process.
    u
        Input (m,) for the next sampling interval, in the units of the robot's inputs.
    state_in_goal_frame
        (n,) when the command acts, in the units of the robot's states.
    pose_utime
        Exposure time of the newest usable frame in us, None before the first.
    value, stage_cost
        Cost of the plan, and of the present state under ``u``; zero unless driving.
    iterations, solved
        Of the solver in this step.
    predicted
        (H + 1, 2): planned positions in the inertial frame in m; empty unless driving.
    finished
        The robot has stopped and there is nothing left to do.
    """

    state: State
    holds: bool
    u: tuple[float, ...]
    state_in_goal_frame: NDArray[np.float64]
    pose_utime: int | None
    value: float = 0.0
    stage_cost: float = 0.0
    iterations: int = 0
    solved: bool = False
    predicted: NDArray[np.float64] = field(default_factory=lambda: np.zeros((0, 2)))
    finished: bool = False

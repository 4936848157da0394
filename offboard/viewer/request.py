"""What a page may ask for, read from what a stranger may send."""

from __future__ import annotations

import json
import math
from typing import Any, NamedTuple

from koopman_lab.errors import LabStateError
from koopman_lab.geometry.planar import Pose, wrap_angle
from koopman_lab.replay.bus_steering import Control
from lcmtypes import replay_control_t

LARGEST_BYTES = 1024
"""A request takes less than 200."""
STOP, ARM, RELEASE, GOAL, REPLAY = "stop", "arm", "release", "goal", "replay"
REPLAY_ACTIONS = {
    "pause": replay_control_t.PAUSE,
    "play": replay_control_t.PLAY,
    "seek": replay_control_t.SEEK,
    "speed": replay_control_t.SPEED,
}
LARGEST_ANGLE_RAD = 1e6


class RequestError(LabStateError):
    """Sent by no page of ours."""


class Request(NamedTuple):
    """What is asked for.

    Attributes
    ----------
    do
        One of the constants.
    robot
        Its name.
    goal
        Set for GOAL only.
    seen_us
        Time of the newest snapshot that the page had got (us); None if it does not say.
    control
        Set for REPLAY only.
    """

    do: str
    robot: str
    goal: Pose | None = None
    seen_us: int | None = None
    control: Control | None = None


def parse_request(text: str) -> Request:
    """Return what was asked for.

    Raises
    ------
    RequestError
        If it is no request.
    """
    if len(text) > LARGEST_BYTES:
        raise RequestError(f"request of {len(text)} characters; none has more than {LARGEST_BYTES}")
    try:
        fields = json.loads(text, parse_constant=_refuse_constant)
    except (ValueError, RecursionError):
        raise RequestError("request: not JSON") from None
    if not isinstance(fields, dict):
        raise RequestError("request: not a JSON object")
    do, robot = fields.get("do"), fields.get("robot")
    if do not in (STOP, ARM, RELEASE, GOAL, REPLAY):
        raise RequestError(f"request: do must be one of {STOP}, {ARM}, {RELEASE}, {GOAL}, {REPLAY}")
    if not isinstance(robot, str):
        raise RequestError("request: robot must be a name")
    seen_us = fields.get("seen_us")
    if seen_us is not None and (type(seen_us) is not int or not 0 <= seen_us < 2**63):
        raise RequestError("request: seen_us must be the time of a snapshot")
    if do == REPLAY:
        action = fields.get("action")
        if not isinstance(action, str) or action not in REPLAY_ACTIONS:
            raise RequestError(f"request: action must be one of {', '.join(REPLAY_ACTIONS)}")
        value = _finite_number(fields.get("value", 0.0), "value")
        return Request(do, robot, None, seen_us, Control(REPLAY_ACTIONS[action], value))
    if do != GOAL:
        return Request(do, robot, None, seen_us)
    x1, x2, theta = (_finite_number(fields.get(key), key) for key in ("x1_m", "x2_m", "theta_rad"))
    if abs(theta) > LARGEST_ANGLE_RAD:
        raise RequestError("request: theta_rad is no angle")
    return Request(do, robot, Pose(x1, x2, wrap_angle(theta)), seen_us)


def _refuse_constant(text: str) -> float:
    raise ValueError(text)


def _finite_number(value: Any, key: str) -> float:
    try:
        if isinstance(value, int | float) and not isinstance(value, bool):
            number = float(value)
            if math.isfinite(number):
                return number
    except OverflowError:
        pass
    raise RequestError(f"request: {key} must be a finite number")

"""What a page may ask for, read from what a stranger may send."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, NamedTuple

from koopman_lab.errors import LabStateError
from koopman_lab.geometry.planar import Pose, wrap_angle
from koopman_lab.replay.bus_steering import Control
from lcmtypes import replay_control_t

LARGEST_BYTES = 1024
"""A request takes less than 200."""
STOP, ARM, RELEASE, GOAL, REPLAY = "stop", "arm", "release", "goal", "replay"
START, REMOVE = "start", "remove"
OF_A_ROBOT, OF_JOBS = (STOP, ARM, RELEASE, GOAL, REPLAY), (START, REMOVE)
REPLAY_ACTIONS = {
    "pause": replay_control_t.PAUSE,
    "play": replay_control_t.PLAY,
    "seek": replay_control_t.SEEK,
    "speed": replay_control_t.SPEED,
}
MOST_VALUES = 16
LONGEST_VALUE = 512
LARGEST_ANGLE_RAD = 1e6
Value = str | int | float | list[int | float]
"""What can be chosen: a name, a number, or a few numbers."""


class RequestError(LabStateError):
    """Sent by no page of ours."""


class Request(NamedTuple):
    """What is asked for.

    Attributes
    ----------
    do
        One of the constants.
    robot
        Its name; empty for what is asked of no robot.
    goal
        Set for GOAL only.
    seen_us
        Time of the newest snapshot that the page had got (us); None if it does not say.
    task, values
        What to start, and what was chosen for it; set for START only.
    number
        Of the job; set for REMOVE only.
    control
        Set for REPLAY only.
    """

    do: str
    robot: str
    goal: Pose | None = None
    seen_us: int | None = None
    task: str = ""
    values: Mapping[str, Value] = MappingProxyType({})
    number: int = 0
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
    if do not in (*OF_A_ROBOT, *OF_JOBS):
        raise RequestError(f"request: do must be one of {', '.join((*OF_A_ROBOT, *OF_JOBS))}")
    seen_us = fields.get("seen_us")
    if seen_us is not None and (type(seen_us) is not int or not 0 <= seen_us < 2**63):
        raise RequestError("request: seen_us must be the time of a snapshot")
    if do == START:
        return Request(do, "", None, seen_us, _name(fields.get("task")), _values(fields))
    if do == REMOVE:
        number = fields.get("number")
        if type(number) is not int or not 0 <= number < 2**63:
            raise RequestError("request: number must be that of a run")
        return Request(do, "", None, seen_us, number=number)
    if not isinstance(robot, str):
        raise RequestError("request: robot must be a name")
    if do == REPLAY:
        action = fields.get("action")
        if not isinstance(action, str) or action not in REPLAY_ACTIONS:
            raise RequestError(f"request: action must be one of {', '.join(REPLAY_ACTIONS)}")
        value = _finite_number(fields.get("value", 0.0), "value")
        return Request(do, robot, None, seen_us, control=Control(REPLAY_ACTIONS[action], value))
    if do != GOAL:
        return Request(do, robot, None, seen_us)
    x1, x2, theta = (_finite_number(fields.get(key), key) for key in ("x1_m", "x2_m", "theta_rad"))
    if abs(theta) > LARGEST_ANGLE_RAD:
        raise RequestError("request: theta_rad is no angle")
    return Request(do, robot, Pose(x1, x2, wrap_angle(theta)), seen_us)


def _name(value: Any) -> str:
    if not isinstance(value, str) or len(value) > LONGEST_VALUE:
        raise RequestError("request: task must be a name")
    return value


def _values(fields: Mapping[str, Any]) -> dict[str, Value]:
    """Return what was chosen, of the types that can be; what fits, the task says."""
    values = fields.get("values")
    if not isinstance(values, dict) or len(values) > MOST_VALUES:
        raise RequestError(f"request: values must be at most {MOST_VALUES} choices")
    for key, value in values.items():
        parts = value if isinstance(value, list) else [value]
        if isinstance(value, str):
            if len(value) > LONGEST_VALUE:
                raise RequestError("request: a value is too long")
        else:
            for part in parts:
                _finite_number(part, key[:LONGEST_VALUE])
    return values


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

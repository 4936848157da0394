"""The two shapes of reference runs as input sequences (paper, section 5.3).

A shape is a profile of body velocities, one at each step, from rest to rest. Between two of them
they change linearly, so the inputs that drive it in open loop follow exactly.
"""

from __future__ import annotations

import math
from enum import IntEnum
from itertools import pairwise

from koopman_lab.config.schema import LabConfig
from koopman_lab.errors import ConfigError
from koopman_lab.geometry.planar import REST, Pose, Velocity
from koopman_lab.robots.table import robot_type
from offboard.desk.floor import require_on_floor

CLOSING_SWING_RAD = 2.404825557695773
"""The first zero of the Bessel function J0: a heading that swings by it, like a cosine in time and
at constant speed, comes back to where it began."""
ROUNDING = 1e-9
"""In steps: what counts as a whole number of them."""


class Shape(IntEnum):
    """Of a run; the numbers are those of ``reference_state_t``."""

    INFINITY = 0
    SQUARE = 1


def start_pose(config: LabConfig, shape: Shape) -> Pose:
    """Return where the robot is placed before each run.

    Raises
    ------
    UsageError
        If that is outside the floor.
    """
    reference = config.reference
    settings = reference.infinity if shape is Shape.INFINITY else reference.square
    start = Pose(*settings.start_pose)
    require_on_floor(start, config.floor, f"reference.{shape.name.lower()}.start_pose")
    return start


def input_sequence(config: LabConfig, shape: Shape) -> list[tuple[float, float]]:
    """Return the inputs of a run, one for each control interval.

    They are (v, omega) in m/s and rad/s or (a, d_omega) in m/s^2 and rad/s^2, as the robot's type
    has it.

    Raises
    ------
    ConfigError
        If the sides or the quarter turns are too short for their speed.
    LabStateError
        If the robot does not roll on two driven wheels.
    """
    profile = _infinity(config) if shape is Shape.INFINITY else _square(config)
    drive = robot_type(config.robot.kind).on_two_wheels("the reference driver")
    dt_s = config.controller.dt_s
    return [drive.input_along(begin, end, dt_s) for begin, end in pairwise([REST, *profile])]


def _infinity(config: LabConfig) -> list[Velocity]:
    """Return the velocities after each step: straight start, one lap, straight stop."""
    reference, dt_s = config.reference, config.controller.dt_s
    shape = reference.infinity
    speed, ramp = (
        shape.speed_m_per_s,
        _ramp_steps(shape.speed_m_per_s, reference.acceleration_m_per_s2, dt_s),
    )
    rising = [speed * k / ramp for k in range(1, ramp + 1)]
    lap = max(2, round(shape.lap_s / dt_s))
    rate = 2.0 * math.pi / (lap * dt_s)
    turning = [CLOSING_SWING_RAD * rate * math.sin(2.0 * math.pi * k / lap) for k in range(1, lap)]
    return [
        *(Velocity(v, 0.0) for v in rising),
        *(Velocity(speed, omega) for omega in [*turning, 0.0]),
        *(Velocity(v, 0.0) for v in [*rising[-2::-1], 0.0]),
    ]


def _square(config: LabConfig) -> list[Velocity]:
    """Return the velocities after each step: four times a side and a quarter turn."""
    reference, dt_s = config.reference, config.controller.dt_s
    shape = reference.square
    side = _trapezoid(
        "reference.square.side_m",
        shape.side_m,
        shape.speed_m_per_s,
        reference.acceleration_m_per_s2,
        dt_s,
    )
    turn = _trapezoid(
        "a quarter turn",
        0.5 * math.pi,
        shape.turn_speed_rad_per_s,
        reference.turn_acceleration_rad_per_s2,
        dt_s,
    )
    return 4 * [*(Velocity(v, 0.0) for v in side), *(Velocity(0.0, omega) for omega in turn)]


def _trapezoid(
    name: str, distance: float, speed: float, acceleration: float, dt_s: float
) -> list[float]:
    """Return speeds after each step that cover ``distance`` exactly, at about ``speed``."""
    ramp = _ramp_steps(speed, acceleration, dt_s)
    flat = round(distance / (speed * dt_s)) - ramp
    if flat < 0:
        raise ConfigError(
            f"{name}: {distance:g} is too short to reach {speed:g} per second at {acceleration:g} "
            "per second squared; lower the speed in reference, or raise the acceleration"
        )
    peak = distance / ((ramp + flat) * dt_s)
    rising = [peak * k / ramp for k in range(1, ramp + 1)]
    return [*rising, *flat * [peak], *rising[-2::-1], 0.0]


def _ramp_steps(speed: float, acceleration: float, dt_s: float) -> int:
    """Return how many steps lead from rest to a speed at no more than the acceleration."""
    return max(1, math.ceil(speed / (acceleration * dt_s) - ROUNDING))

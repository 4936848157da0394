"""The kinematic robot, driven by velocities (paper, section 3.1)."""

from __future__ import annotations

from typing import Any

import numpy as np

from koopman_lab.robots.robot_type import Array, Components, Quantity, RobotType
from koopman_lab.robots.rolling import roll


def _components(x: Components, u: Components, dt_s: Any, m: Any) -> Components:
    return roll(x, u, [0.0, 0.0], dt_s, m)


def _standing(x: Array, u_max: Array, dt_s: float, steps: int) -> Array:
    """Return no input: a robot that is driven by velocities stands at once."""
    del x, dt_s
    return np.zeros((steps, len(u_max)))


def _turn(omega: float, speed: float) -> tuple[Array, Array]:
    del speed
    return np.zeros(0), np.array([0.0, omega])


KINEMATIC = RobotType(
    name="kinematic",
    title="kinematic robot",
    states=(Quantity("x1", "m"), Quantity("x2", "m"), Quantity("theta", "rad")),
    inputs=(Quantity("v", "m/s"), Quantity("omega", "rad/s")),
    components=_components,
    drifts=False,
    sideways=(1,),
    speeds_at=(),
    braking=_standing,
    effort=np.ones,
    turn=_turn,
)

"""The second-order robot, driven by accelerations (paper, section 3.2)."""

from __future__ import annotations

from typing import Any

import numpy as np

from koopman_lab.robots.robot_type import Array, Components, Quantity, RobotType
from koopman_lab.robots.rolling import roll


def _components(z: Components, u: Components, dt_s: Any, m: Any) -> Components:
    pose = roll(z[:3], z[3:], u, dt_s, m)
    return [*pose, z[3] + u[0] * dt_s, z[4] + u[1] * dt_s]


def _braking(x: Array, u_max: Array, dt_s: float, steps: int) -> Array:
    inputs = np.zeros((steps, len(u_max)))
    speeds = x[3:]
    for u in inputs:
        u[:] = np.clip(-speeds / dt_s, -u_max, u_max)
        speeds = speeds + dt_s * u
    return inputs


def _effort(horizon: int) -> Array:
    """Return a course that speeds up for half the horizon and slows down again."""
    course = np.ones(horizon)
    course[(horizon + 1) // 2 :] *= -1.0
    return course


def _turn(omega: float, speed: float) -> tuple[Array, Array]:
    return np.array([speed, omega]), np.zeros(2)


DYNAMIC = RobotType(
    name="dynamic",
    title="second-order robot",
    states=(
        *(Quantity("x1", "m"), Quantity("x2", "m"), Quantity("theta", "rad")),
        *(Quantity("v", "m/s"), Quantity("omega", "rad/s")),
    ),
    inputs=(Quantity("a", "m/s²"), Quantity("d_omega", "rad/s²")),
    components=_components,
    drifts=True,
    sideways=(1,),
    speeds_at=(3, 4),
    braking=_braking,
    effort=_effort,
    turn=_turn,
)

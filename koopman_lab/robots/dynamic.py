"""The second-order robot, driven by accelerations (paper, section 3.2)."""

from __future__ import annotations

from importlib import resources
from math import pi, radians
from typing import Any

import lcmtypes
from koopman_lab.robots.body_drive import BY_ACCELERATIONS
from koopman_lab.robots.command_message import CommandMessage
from koopman_lab.robots.robot_type import Array, Components, Quantity, RobotType
from koopman_lab.robots.standard_runs import StandardRuns
from koopman_lab.robots.wheel_kinematics import roll


def _components(z: Components, u: Components, dt_s: Any, m: Any) -> Components:
    pose = roll(z[:3], z[3:], u, dt_s, m)
    return [*pose, z[3] + u[0] * dt_s, z[4] + u[1] * dt_s]


def _braking(x: Array, u_max: Array, dt_s: float, steps: int) -> Array:
    import numpy as np

    inputs = np.zeros((steps, len(u_max)))
    speeds = x[3:]
    for u in inputs:
        u[:] = np.clip(-speeds / dt_s, -u_max, u_max)
        speeds = speeds + dt_s * u
    return inputs


def _effort(horizon: int) -> Array:
    """Return a course that speeds up for half the horizon and slows down again."""
    import numpy as np

    course = np.ones(horizon)
    course[(horizon + 1) // 2 :] *= -1.0
    return course


def _turn(omega: float, speed: float) -> tuple[Array, Array]:
    import numpy as np

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
    command=CommandMessage(
        "ACCELERATION_CMD",
        lcmtypes.acceleration_command_t,
        ("a_m_per_s2", "d_omega_rad_per_s2"),
    ),
    drive=BY_ACCELERATIONS,
    defaults=resources.files("koopman_lab.config") / "defaults" / "dynamic.yaml",
    runs=StandardRuns(
        park_start=(-1.1, -0.53, radians(-42.68)),  # section 5.4, the lab
        simulate_start=(1.0, 0.2, pi / 4.0),  # section 5.4, the simulation
        simulate_s=20.0,  # section 5.4: after which the paper looks at x2
        demo_segments=30,  # assumption: minutes instead of the hour that the paper's 100 take
        bench_segments=15,  # assumption: enough to excite the dictionary
    ),
)

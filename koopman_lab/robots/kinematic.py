"""The kinematic robot, driven by velocities (paper, section 3.1)."""

from __future__ import annotations

from importlib import resources
from math import pi
from typing import Any

import lcmtypes
from koopman_lab.robots.body_drive import BY_VELOCITIES
from koopman_lab.robots.command_message import CommandMessage
from koopman_lab.robots.robot_type import Array, Components, Quantity, RobotType
from koopman_lab.robots.standard_runs import StandardRuns
from koopman_lab.robots.wheel_kinematics import roll


def _components(x: Components, u: Components, dt_s: Any, m: Any) -> Components:
    return roll(x, u, [0.0, 0.0], dt_s, m)


def _standing(x: Array, u_max: Array, dt_s: float, steps: int) -> Array:
    """Return no input: a robot that is driven by velocities stands at once."""
    import numpy as np

    del x, dt_s
    return np.zeros((steps, len(u_max)))


def _effort(horizon: int) -> Array:
    """Return full effort all the way."""
    import numpy as np

    return np.ones(horizon)


def _turn(omega: float, speed: float) -> tuple[Array, Array]:
    import numpy as np

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
    effort=_effort,
    turn=_turn,
    command=CommandMessage(
        "VELOCITY_CMD", lcmtypes.velocity_command_t, ("v_m_per_s", "omega_rad_per_s")
    ),
    drive=BY_VELOCITIES,
    defaults=resources.files("koopman_lab.config") / "defaults" / "kinematic.yaml",
    runs=StandardRuns(
        park_start=(0.0, 0.5, 0.0),  # section 4, the lab
        simulate_start=(-1.0, -0.5, -pi / 6.0),  # section 4, the simulation
        simulate_s=10.0,  # section 4: after which the paper looks at x2
        random_starts=((-1.0, 1.0), (-1.0, 1.0), (-pi, pi)),  # section 4
        study_dt_s=0.1,  # section 4: sampling time of its simulations
        demo_segments=5,  # section 4
        bench_segments=5,
    ),
)

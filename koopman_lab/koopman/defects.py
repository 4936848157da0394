"""What a model does that no rolling wheel can: sideways motion, and a turn that changes lengths.

Only robots that turn on the spot are asked
(:attr:`~koopman_lab.robots.robot_type.RobotType.turn`).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from koopman_lab.koopman.bilinear_model import BilinearModel
from koopman_lab.robots.robot_type import Array

TURN_RAD_PER_S = 1.0
"""Yaw rate at which a model is asked to turn on the spot."""
SPEED_M_PER_S = 0.2
"""Speed of the paper's basis inputs, with which v*cos(theta) and v*sin(theta) are measured."""
ORIENTATIONS = 72
PAIRS = (("cos(theta)", "sin(theta)"), ("v*cos(theta)", "v*sin(theta)"))
"""Observables that a turn only rotates."""


@dataclass(frozen=True)
class Defects:
    """How a model breaks the geometry of a turn on the spot with 1 rad/s, the worst orientation.

    ``sideways_m_per_rad`` is the motion across the heading in one step (m, for each rad/s);
    ``growth_per_step`` by what share the length of (cos, sin) grows in a step without
    reprojection, None where the dictionary has no such pair.
    """

    sideways_m_per_rad: float
    growth_per_step: float | None


def defects(model: BilinearModel) -> Defects | None:
    """Return what the model does in a turn on the spot; None if its robot knows none."""
    if model.robot.turn is None:
        return None
    theta = np.linspace(-np.pi, np.pi, ORIENTATIONS, endpoint=False)
    x, u = _turn_in_place(model, theta, 0.0)
    heading = theta + 0.5 * TURN_RAD_PER_S * model.dt_s
    moved = model.step(x, u)[:, :2]
    sideways = np.abs(-np.sin(heading) * moved[:, 0] + np.cos(heading) * moved[:, 1])
    names = model.dictionary.names
    pair = next((p for p in PAIRS if p[0] in names and p[1] in names), None)
    growth = None
    if pair is not None:
        rows = [names.index(name) for name in pair]
        x, u = _turn_in_place(model, theta, SPEED_M_PER_S)
        psi = model.dictionary.lift(x)
        after = np.einsum("...ij,...j->...i", model.matrix(u), psi)
        lengths = np.hypot(*after[:, rows].T) / np.hypot(*psi[:, rows].T)
        growth = float(np.abs(lengths - 1.0).max())
    return Defects(float(sideways.max()) / TURN_RAD_PER_S, growth)


def _turn_in_place(model: BilinearModel, theta: Array, speed: float) -> tuple[Array, Array]:
    """Return states (k, n) at the origin and inputs (k, m) that turn with TURN_RAD_PER_S."""
    assert model.robot.turn is not None  # by defects
    rest, u = model.robot.turn(TURN_RAD_PER_S, speed)
    pose = np.column_stack([np.zeros((len(theta), 2)), theta])
    x = np.column_stack([pose, np.tile(rest, (len(theta), 1))])
    return x, np.tile(u, (len(theta), 1))

"""The kinematics of two driven wheels that do not slip, for robots of that family."""

from __future__ import annotations

from functools import cache
from typing import Any

from koopman_lab.robots.robot_type import Components


@cache
def _quadrature() -> list[tuple[float, float]]:
    """Return the Gauss-Legendre nodes and weights on [0, 1].

    Six points integrate cos and sin of the angle over a control interval to rounding for every turn
    that the robot can make in it.
    """
    from numpy.polynomial.legendre import leggauss

    nodes, weights = leggauss(6)
    return [(float(0.5 * (1 + n)), float(0.5 * w)) for n, w in zip(nodes, weights, strict=True)]


def roll(pose: Components, speed: Components, change: Components, dt_s: Any, m: Any) -> Components:
    """Return the pose after an interval of linearly changing v and omega.

    The integrals are Fresnel's; for the paper's equations see its sections 3.1 and 3.2.

    Parameters
    ----------
    pose
        x1, x2, theta (m, m, rad) at the start.
    speed
        v and omega (m/s, rad/s) at the start.
    change
        Their derivatives (m/s^2, rad/s^2).
    dt_s
        Length of the interval (s).
    m
        The module of functions to use.
    """
    x1, x2, theta = pose
    v, omega = speed
    a, d_omega = change
    for node, weight in _quadrature():
        time = node * dt_s
        angle = theta + omega * time + d_omega * (0.5 * time * time)
        distance = (v + a * time) * (weight * dt_s)
        x1 = x1 + distance * m.cos(angle)
        x2 = x2 + distance * m.sin(angle)
    return [x1, x2, theta + omega * dt_s + d_omega * (0.5 * dt_s * dt_s)]

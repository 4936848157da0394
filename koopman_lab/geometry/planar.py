"""Angles, planar poses, and wheel speeds against body velocities.

A pose is ``(x1, x2, theta)`` in m, m, rad, as in the paper's section 3.1.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple, TypeVar

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

Angle = TypeVar("Angle", float, "NDArray[np.float64]")

PI, TAU = math.pi, 2.0 * math.pi


class Pose(NamedTuple):
    """A planar pose: m, m, rad."""

    x1: float
    x2: float
    theta: float


ORIGIN = Pose(0.0, 0.0, 0.0)

PlainPose = tuple[float, float, float]
"""The same, ``(x1, x2, theta)``, where poses come so often that making named ones takes time."""


class Velocity(NamedTuple):
    """A body velocity: m/s, rad/s."""

    v: float
    omega: float


REST = Velocity(0.0, 0.0)


def wrap_angle(theta: Angle) -> Angle:
    """Shift an angle (rad; a float or an array) by a multiple of 2 pi into (-pi, pi]."""
    wrapped = PI - (PI - theta) % TAU
    if isinstance(wrapped, (float, int)):
        return PI if wrapped <= -PI else wrapped
    import numpy as np  # whoever has an array has loaded it

    return np.where(wrapped <= -math.pi, math.pi, wrapped)


def compose(frame: Pose, pose: Pose) -> Pose:
    """Return ``pose``, given relative to ``frame``, in the frame that ``frame`` is given in."""
    c, s = math.cos(frame.theta), math.sin(frame.theta)
    return Pose(
        frame.x1 + c * pose.x1 - s * pose.x2,
        frame.x2 + s * pose.x1 + c * pose.x2,
        wrap_angle(frame.theta + pose.theta),
    )


def relative_to(frame: Pose, pose: Pose) -> Pose:
    """Return ``pose`` as seen from ``frame``; the inverse of :func:`compose`."""
    c, s = math.cos(frame.theta), math.sin(frame.theta)
    d1, d2 = pose.x1 - frame.x1, pose.x2 - frame.x2
    return Pose(c * d1 + s * d2, -s * d1 + c * d2, wrap_angle(pose.theta - frame.theta))


def body_velocity(
    left: float, right: float, wheel_radius_m: float, track_width_m: float
) -> tuple[float, float]:
    """Return ``(v, omega)`` in m/s and rad/s of the wheel speeds in rad/s.

    The paper's kinematic relation, section 3.1.
    """
    v = 0.5 * wheel_radius_m * (left + right)
    omega = wheel_radius_m / track_width_m * (right - left)
    return v, omega


def wheel_speeds(
    v: float, omega: float, wheel_radius_m: float, track_width_m: float
) -> tuple[float, float]:
    """Return ``(left, right)`` wheel speeds in rad/s; the inverse of :func:`body_velocity`."""
    half = 0.5 * omega * track_width_m
    return (v - half) / wheel_radius_m, (v + half) / wheel_radius_m


def move_along_arc(pose: Pose, distance_m: float, turn_rad: float) -> Pose:
    """Return the pose after rolling ``distance_m`` while turning ``turn_rad`` at a constant rate.

    This is the exact solution of the nominal kinematics for constant v and omega; the chord
    keeps it accurate for any small turn. The returned angle is not wrapped.
    """
    half = 0.5 * turn_rad
    chord = distance_m * (math.sin(half) / half if abs(half) > 1e-8 else 1.0)
    direction = pose.theta + half
    return Pose(
        pose.x1 + chord * math.cos(direction),
        pose.x2 + chord * math.sin(direction),
        pose.theta + turn_rad,
    )

"""Trapezoidal velocity profiles, computed step by step from the distance that is left."""

from __future__ import annotations

import math


def stopping_speed(distance: float, acceleration: float, reaction_s: float) -> float:
    """Return the speed, signed like ``distance``, from which braking just ends there.

    The brakes act after ``reaction_s``: solves ``speed * reaction_s + speed^2 / (2 acceleration)
    = distance``. Units: m and m/s^2, or rad and rad/s^2.
    """
    speed = acceleration * (
        math.sqrt(reaction_s**2 + 2.0 * abs(distance) / acceleration) - reaction_s
    )
    return math.copysign(speed, distance)


def clip(value: float, largest: float) -> float:
    """Return ``value`` limited to plus and minus ``largest``."""
    return min(largest, max(-largest, value))


def slew(present: float, target: float, largest_change: float) -> float:
    """Return ``present`` moved towards ``wanted`` by at most ``largest_change``."""
    return present + clip(target - present, largest_change)

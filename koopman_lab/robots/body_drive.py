"""How the inputs of a robot on two driven wheels move its body velocity (v, omega).

Sampler, reference driver and motor loop plan in body velocities; what they command follows from
here. Velocities are pairs of m/s and rad/s.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Literal

Speeds = tuple[float, float]
Limit = Literal["v_m_per_s", "omega_rad_per_s", "a_m_per_s2", "d_omega_rad_per_s2"]


@dataclass(frozen=True)
class BodyDrive(ABC):
    """What an input does to the body velocity.

    Attributes
    ----------
    limits
        Keys of ``motor_loop.limits`` that bound the two inputs.
    integrates
        Whether inputs add up: the velocity changes evenly over each control interval, and goes on
        without those that were lost on the way. Otherwise an input sets the velocity anew.
    """

    limits: tuple[Limit, Limit]
    integrates: bool

    @abstractmethod
    def velocity_after(self, velocity: Speeds, u: Speeds, dt_s: float) -> Speeds:
        """Return the nominal velocity when ``u`` has acted on ``velocity`` for a time (s)."""

    @abstractmethod
    def input_towards(self, velocity: Speeds, target: Speeds, dt_s: float) -> Speeds:
        """Return the input that leads from one velocity to another within a time (s)."""

    @abstractmethod
    def input_along(self, begin: Speeds, end: Speeds, dt_s: float) -> Speeds:
        """Return the input that moves the robot as a velocity does that changes linearly.

        It changes from ``begin`` to ``end`` over a time (s).
        """

    def mean(self, begin: Speeds, end: Speeds) -> Speeds:
        """Return the nominal mean velocity of an interval between these two."""
        if not self.integrates:
            return end
        return 0.5 * (begin[0] + end[0]), 0.5 * (begin[1] + end[1])


class VelocityDrive(BodyDrive):
    """Inputs are velocities (v, omega), taken up at once (paper, section 3.1)."""

    def velocity_after(self, velocity: Speeds, u: Speeds, dt_s: float) -> Speeds:
        """Return the input."""
        del velocity, dt_s
        return u

    def input_towards(self, velocity: Speeds, target: Speeds, dt_s: float) -> Speeds:
        """Return the target."""
        del velocity, dt_s
        return target

    def input_along(self, begin: Speeds, end: Speeds, dt_s: float) -> Speeds:
        """Return the mean velocity, which covers the same way and the same turn."""
        del dt_s
        return 0.5 * (begin[0] + end[0]), 0.5 * (begin[1] + end[1])


class AccelerationDrive(BodyDrive):
    """Inputs are accelerations (a, d_omega) in m/s^2 and rad/s^2 (paper, section 3.2)."""

    def velocity_after(self, velocity: Speeds, u: Speeds, dt_s: float) -> Speeds:
        """Return the velocity with what the accelerations add to it."""
        return velocity[0] + u[0] * dt_s, velocity[1] + u[1] * dt_s

    def input_towards(self, velocity: Speeds, target: Speeds, dt_s: float) -> Speeds:
        """Return the constant accelerations between the velocities."""
        return (target[0] - velocity[0]) / dt_s, (target[1] - velocity[1]) / dt_s

    def input_along(self, begin: Speeds, end: Speeds, dt_s: float) -> Speeds:
        """Return the same: the velocity changes linearly under constant accelerations."""
        return self.input_towards(begin, end, dt_s)


BY_VELOCITIES = VelocityDrive(("v_m_per_s", "omega_rad_per_s"), integrates=False)
BY_ACCELERATIONS = AccelerationDrive(("a_m_per_s2", "d_omega_rad_per_s2"), integrates=True)

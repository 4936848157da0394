"""What to sample next: drawn states, the launch, and whether a run is worth its drive."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from koopman_lab.config import sampler
from koopman_lab.config.sampler import StateSet
from koopman_lab.config.schema import LabConfig
from koopman_lab.geometry.planar import REST, Pose, Velocity, move_along_arc, wrap_angle
from koopman_lab.robots.table import robot_type
from offboard.desk.floor import require_sets_on_floor


class Draw(NamedTuple):
    """A drawn state z~ = (pose, velocity) of section 5.1."""

    pose: Pose
    velocity: Velocity


class Launch(NamedTuple):
    """A constant input for some steps, which nominally leads from rest to a velocity."""

    steps: int
    u: tuple[float, float]


def contains(box: StateSet, pose: Pose, velocity: Velocity) -> bool:
    """Return whether a state lies in a set."""
    values = (pose.x1, pose.x2, wrap_angle(pose.theta), *velocity)
    ranges = (box.x1_m, box.x2_m, box.theta_rad, box.v_m_per_s, box.omega_rad_per_s)
    return all(low <= x <= high for x, (low, high) in zip(values, ranges, strict=True))


class Planner:
    """Draws states and foresees runs on the nominal model.

    Parameters
    ----------
    config
        Sets, limits, control interval and the robot's type.
    rng
        Source of the draws.

    Raises
    ------
    LabStateError
        If the robot does not roll on two driven wheels.
    ConfigError
        If the sets reach beyond the floor.
    """

    def __init__(self, config: LabConfig, rng: np.random.Generator) -> None:
        require_sets_on_floor(config)
        self._sampler: sampler.Sampler = config.sampler
        self._dt_s = config.controller.dt_s
        robot = robot_type(config.robot.kind)
        self._drive = robot.on_two_wheels("the sampler")
        self._draws_velocity = bool(robot.speeds_at)
        self._rng = rng

    def draw(self) -> Draw:
        """Draw a state uniformly from the draw set; one without velocities starts at rest."""
        box = self._sampler.draw_set
        x1, x2, theta, v, omega = (
            float(self._rng.uniform(*r))
            for r in (box.x1_m, box.x2_m, box.theta_rad, box.v_m_per_s, box.omega_rad_per_s)
        )
        velocity = Velocity(v, omega) if self._draws_velocity else REST
        return Draw(Pose(x1, x2, theta), velocity)

    def launch(self, velocity: Velocity) -> Launch:
        """Return an admissible constant input that nominally leads from rest to ``velocity``."""
        s = self._sampler
        shortest_s = max(
            abs(velocity.v) / s.acceleration_m_per_s2,
            abs(velocity.omega) / s.turn_acceleration_rad_per_s2,
        )
        steps = math.ceil(shortest_s / self._dt_s)
        if steps == 0:
            return Launch(0, (0.0, 0.0))
        return Launch(steps, self._drive.input_towards(REST, velocity, steps * self._dt_s))

    def worth_driving(self, start: Pose, launch: Launch, basis_input: tuple[float, float]) -> bool:
        """Return whether the nominal robot stays in Z for the smallest number of basis steps."""
        inside, pose, velocity = True, start, REST
        for u in [launch.u] * launch.steps + [basis_input] * self._sampler.smallest_steps:
            pose, velocity = self._step(pose, velocity, u)
            inside = inside and contains(self._sampler.admissible_set, pose, velocity)
        return inside

    def velocity_after(self, velocity: Velocity, u: tuple[float, float]) -> Velocity:
        """Return the nominal velocity after one step with input ``u``."""
        return Velocity(*self._drive.velocity_after(velocity, u, self._dt_s))

    def _step(
        self, pose: Pose, velocity: Velocity, u: tuple[float, float]
    ) -> tuple[Pose, Velocity]:
        after = self.velocity_after(velocity, u)
        # The mean velocity of the step is exact in the angle and good to microns in position.
        v, omega = self._drive.mean(velocity, after)
        return move_along_arc(pose, v * self._dt_s, omega * self._dt_s), after

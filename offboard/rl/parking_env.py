"""The parking task as a Gymnasium environment: plant, motor loop, stage cost."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
from gymnasium.spaces import Box
from numpy.typing import NDArray

from koopman_lab.api.arguments import rows
from koopman_lab.api.chosen_config import chosen_config
from koopman_lab.config.presets import Preset
from koopman_lab.config.schema import LabConfig
from koopman_lab.errors import ArgumentError
from koopman_lab.geometry.planar import ORIGIN, Pose, relative_to
from koopman_lab.koopman.dictionary import dictionary
from koopman_lab.mpc.configured_cost import stage_cost
from koopman_lab.robots.robot_type import POSE_NAMES
from koopman_lab.robots.table import robot_type
from koopman_lab.studies.parking import start_box
from koopman_lab.units import US_PER_S
from offboard.desk.floor import excess_m, require_on_floor
from offboard.desk.parked import is_inside
from offboard.rl.driven_robot import DrivenRobot
from offboard.rl.floor_picture import floor_picture

Array = NDArray[np.float64]

LARGEST_SPEEDS = 3.0
"""Observed speeds are at most so many times the limits of the motor loop: three times as fast
overshoots no wheel."""
BEYOND_FLOOR_M = 1.0
"""How far outside the floor a robot can be when it is seen there: it is seen each sampling time."""


class ParkingEnv(gymnasium.Env[Array, Array]):
    """Drive the simulated robot to a goal, behind the motor loop that a real one has.

    There are no bus, no radio and no cameras: what is observed is true, and an action counts in the
    motor loop's next tick. Motors, body, battery, encoders and faults are those of the preset.

    **Observation** (n,): the robot's state relative to the goal, in the units of its states; the
    angle lies in (-pi, pi]. It is what ``koopman_lab.Controller.step`` takes.

    **Action** (m,): the input as a share of the largest one, ``controller.u_max``, each in [-1, 1];
    what lies outside is cut off. It acts for one sampling time, ``controller.dt_s``.

    **Reward**: minus the stage cost (paper, section 3.3) of the state before and the input, so that
    a return is minus the cost of the closed loop. Who leaves the floor, or is stopped by the motor
    loop, also pays the stage cost at the end for all steps that are left, as if the robot stood
    there: leaving early must not be a way to pay less.

    **End**: terminated when parked, which is inside ``controller.parked_position_m`` and
    ``parked_angle_rad`` for ``parked_hold_s``, or with a robot off the floor or stopped; truncated
    after ``controller.time_limit_s``.

    **Info**: ``pose`` (3,) in the inertial frame (m, m, rad), ``velocity`` (2,) (m/s, rad/s),
    ``time_s``, and ``end``: empty, ``parked``, ``off the floor``, ``stopped`` or ``time limit``.

    Parameters
    ----------
    config
        A configuration, or a YAML file with any part of one; None for the defaults.
    robot
        The robot's kind, where the configuration does not say it.
    preset
        What is simulated, where ``config`` is no whole configuration.
    goal
        Where to drive (m, m, rad); :meth:`reset` may name another.
    render_mode
        ``rgb_array`` for pictures of the floor, or None.
    settings
        Other settings by the keys of the section ``controller``, such as ``cost="ce"``.

    Raises
    ------
    ConfigError
        If the configuration is not valid, or nothing is simulated.
    UsageError
        If the goal is not on the floor.
    LabStateError
        If the robot does not roll on two driven wheels.
    """

    metadata: dict[str, Any] = {"render_modes": ["rgb_array"], "render_fps": 20}  # noqa: RUF012

    def __init__(
        self,
        config: LabConfig | str | Path | None = None,
        *,
        robot: str | None = None,
        preset: str = Preset.lab,
        goal: tuple[float, float, float] = ORIGIN,
        render_mode: str | None = None,
        **settings: Any,
    ) -> None:
        if render_mode not in (None, *self.metadata["render_modes"]):
            raise ArgumentError(f"render_mode: {render_mode!r}, expected 'rgb_array' or None")
        self.config = chosen_config(config, robot, settings, preset=preset)
        """The whole configuration."""
        self.config.require_simulation()
        controller, limits = self.config.controller, self.config.motor_loop.limits
        self.robot = robot_type(self.config.robot.kind)
        """Which robot is driven."""
        self.robot.on_two_wheels("the environment")
        self.u_max = np.array(controller.u_max)
        """The inputs of which an action is a share (m,)."""
        self.render_mode = render_mode
        self.metadata = self.metadata | {"render_fps": max(1, round(1.0 / controller.dt_s))}
        self._goal = self._default_goal = self._on_floor(goal, "goal")
        self._cost = stage_cost(
            controller, self.robot, dictionary(self.config.model.dictionary, self.robot.name)
        )
        floor = self.config.floor
        reach = float(np.hypot(np.ptp(floor.x1_m), np.ptp(floor.x2_m))) + BEYOND_FLOOR_M
        fastest = LARGEST_SPEEDS * limits.v_m_per_s, LARGEST_SPEEDS * limits.omega_rad_per_s
        high = self.robot.state((reach, reach, np.pi), fastest)
        self.observation_space = Box(-high, high, dtype=np.float64)
        self.action_space = Box(-1.0, 1.0, self.u_max.shape, np.float64)
        self._dt_us = round(controller.dt_s * US_PER_S)
        self._most_steps = max(1, round(controller.time_limit_s / controller.dt_s))
        self._hold_steps = round(controller.parked_hold_s / controller.dt_s)
        self._driven: DrivenRobot | None = None
        self._steps = self._inside_steps = 0
        self._end = ""
        self._path: list[Pose] = []

    def reset(
        self, *, seed: int | None = None, options: Mapping[str, Any] | None = None
    ) -> tuple[Array, dict[str, Any]]:
        """Place the robot at rest, and return the first observation and info.

        Parameters
        ----------
        seed
            Of the starts and the error of placing; None to go on drawing.
        options
            ``start`` and ``goal``, poses (m, m, rad) in the inertial frame. Without a start it is
            drawn from where the paper's studies draw theirs.

        Raises
        ------
        ArgumentError
            If an option is none of these, or no pose.
        UsageError
            If a pose is not on the floor.
        """
        super().reset(seed=seed)
        chosen = dict(options or {})
        goal = chosen.pop("goal", None)
        start = chosen.pop("start", None)
        if chosen:
            raise ArgumentError(f"options: unknown {', '.join(chosen)}; known: start, goal")
        self._goal = self._default_goal if goal is None else self._on_floor(goal, "goal")
        if start is None:
            low, high = np.array(start_box(self.config)).T
            start = self.np_random.uniform(low, high)
        self._driven = DrivenRobot(self.config, self.np_random, self._on_floor(start, "start"))
        self._steps, self._inside_steps, self._end = 0, 0, ""
        self._path = [self._driven.pose]
        return self._look(), self._info()

    def step(self, action: Array) -> tuple[Array, float, bool, bool, dict[str, Any]]:
        """Apply an action for one sampling time.

        Returns
        -------
        Observation, reward, whether terminated, whether truncated, and info.

        Raises
        ------
        ArgumentError
            If the action has another shape, or is not finite.
        """
        driven = self._begun()
        names = [f"share of {name}" for name in self.robot.input_names]
        shares = rows(action, "action", names, f"the {self.robot.name} robot", "")
        u = np.clip(shares, -1.0, 1.0) * self.u_max
        reward = -self._stage_cost(u)
        driven.apply(u.tolist(), driven.now_us + self._dt_us)
        self._steps += 1
        self._path.append(driven.pose)
        x = self._look()
        floor = self.config.floor
        if driven.is_stopped or excess_m(floor, driven.pose.x1, driven.pose.x2) > 0.0:
            self._end = "stopped" if driven.is_stopped else "off the floor"
            left = self._most_steps - self._steps
            reward -= left * self._stage_cost(np.zeros_like(u))
        elif self._inside_steps > self._hold_steps:  # as for the controller, since the first look
            self._end = "parked"
        terminated = bool(self._end)
        truncated = not terminated and self._steps >= self._most_steps
        if truncated:
            self._end = "time limit"
        return x, reward, terminated, truncated, self._info()

    def render(self) -> NDArray[np.uint8] | None:
        """Return a picture of the floor (height, width, 3), with the path up to now.

        None without a ``render_mode``.
        """
        if self.render_mode is None:
            return None
        self._begun()
        return floor_picture(self.config.floor, self._goal, self._path)

    def _begun(self) -> DrivenRobot:
        if self._driven is None:
            raise gymnasium.error.ResetNeeded("call reset() before step() and render()")
        return self._driven

    def _on_floor(self, value: Any, what: str) -> Pose:
        pose = Pose(*rows(value, what, POSE_NAMES, "a pose", "").tolist())
        require_on_floor(pose, self.config.floor, what)
        return pose

    def _look(self) -> Array:
        """Return the observation, and count the looks in a row that show the robot at the goal."""
        x = self._observation()
        inside = is_inside(x, self.config.controller, self.robot)
        self._inside_steps = self._inside_steps + 1 if inside else 0
        return x

    def _observation(self) -> Array:
        driven = self._begun()
        return self.robot.state(relative_to(self._goal, driven.pose), driven.velocity)

    def _stage_cost(self, u: Array) -> float:
        return float(self._cost(self._observation(), u))

    def _info(self) -> dict[str, Any]:
        driven = self._begun()
        return {
            "pose": np.array(driven.pose),
            "velocity": np.array(driven.velocity),
            "time_s": driven.now_us / US_PER_S,
            "end": self._end,
        }

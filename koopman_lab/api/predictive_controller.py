"""The predictive controller as a person uses it in Python: one step, or a closed loop."""

from __future__ import annotations

import math
from typing import Any

from numpy.typing import ArrayLike

from koopman_lab.api.arguments import FilePath, rows, state
from koopman_lab.api.chosen_config import chosen_config
from koopman_lab.api.learned_model import Model, as_model
from koopman_lab.config.schema import LabConfig
from koopman_lab.errors import ArgumentError
from koopman_lab.evaluation.fit_to_drive import require_fit_to_drive
from koopman_lab.mpc.receding_horizon import Decision, receding_horizon, solver_of
from koopman_lab.predictors.nominal import NominalPrediction
from koopman_lab.predictors.predictor import PredictionModel, require_robot
from koopman_lab.predictors.table import prediction_of
from koopman_lab.robots.robot_type import RobotType
from koopman_lab.robots.table import robot_type
from koopman_lab.studies.closed_loop import Run, closed_loop


class Controller:
    """Finds the input that brings a robot to the origin: the goal, in whose frame states are given.

    It is the receding-horizon strategy of the paper (section 2.1). Where a goal lies elsewhere,
    :func:`koopman_lab.geometry.planar.relative_to` turns a pose into its frame.

    Parameters
    ----------
    model
        What it plans with, or the file of it; None for the robot's nominal equations.
    config
        A configuration, or a YAML file with any part of one; None for the defaults of the robot.
    robot
        The robot's kind, where neither model nor configuration say it.
    judge
        Whether to refuse a model that would drive the robot the wrong way. In a simulation one may
        want to see what such a model does.
    settings
        Other settings by the keys of the section ``controller``, such as ``cost="ce"``,
        ``horizon=40``, ``reprojection=False`` or ``weights={"ce": {"q": ..., "r": ...}}``;
        `klab config show` lists them. The sampling time ``dt_s`` is the model's unless a
        configuration or a setting says another.

    Raises
    ------
    ConfigError
        If a setting is not allowed, or the weights do not fit the cost.
    ModelError
        If the model cannot be read, must not drive a robot, or is of another robot or sampling time
        than the configuration.
    """

    def __init__(
        self,
        model: Model | FilePath | None = None,
        config: LabConfig | FilePath | None = None,
        *,
        robot: str | None = None,
        judge: bool = True,
        **settings: Any,
    ) -> None:
        loaded = None if model is None else as_model(model).learned
        if loaded is not None and config is None:
            robot = robot or loaded.robot.name
            settings = {"dt_s": loaded.dt_s} | settings
        self.config = chosen_config(config, robot, settings)
        """The whole configuration."""
        kind, controller = self.config.robot.kind, self.config.controller
        if loaded is None:
            self._prediction: PredictionModel = NominalPrediction(kind, controller.dt_s)
        else:
            require_robot(loaded, kind)
            if judge:
                require_fit_to_drive(loaded, self.config)
            self._prediction = prediction_of(loaded, controller)
        self._name = "the nominal equations" if loaded is None else loaded.name
        self._solver = solver_of(self._prediction, self.config)
        self._optimiser = receding_horizon(self._prediction, self.config, solver=self._solver)

    @property
    def robot(self) -> RobotType:
        """Return which robot it drives."""
        return robot_type(self.config.robot.kind)

    @property
    def dt_s(self) -> float:
        """Return the sampling time in s."""
        return self.config.controller.dt_s

    def step(self, x: ArrayLike) -> Decision:
        """Return the input for the next sampling time, and the plan that it begins.

        States of successive calls are one sampling time apart; after a pause or at a new goal, call
        :meth:`restart` first.

        Parameters
        ----------
        x
            State (n,) relative to the goal; or a pose (m, m, rad), which is that at rest.

        Raises
        ------
        ArgumentError
            If it is neither, or a number is not finite.
        """
        return self._optimiser.step(state(x, self.robot, "x"))

    def restart(self) -> None:
        """Forget the plan of the step before."""
        self._optimiser.restart()

    def stage_cost(self, x: ArrayLike, u: ArrayLike) -> float:
        """Return what a state (n,) relative to the goal and an input (m,) cost (section 3.3).

        Raises
        ------
        ArgumentError
            If the shapes do not fit the robot, or a number is not finite.
        """
        owner = f"the {self.robot.name} robot"
        u_checked = rows(u, "u", self.robot.input_names, owner, "")
        return self._optimiser.stage_cost(state(x, self.robot, "x"), u_checked)

    def simulate(self, start: ArrayLike, duration_s: float | None = None) -> Run:
        """Return what it does with the nominal robot; its own plan is left alone.

        Parameters
        ----------
        start
            State (n,) relative to the goal; or a pose (m, m, rad), which is that at rest.
        duration_s
            Length in s, rounded to whole sampling times; None for that of the paper's simulations
            of the robot.

        Raises
        ------
        ArgumentError
            If the start is no state, or the time is shorter than one step.
        """
        x0 = state(start, self.robot, "start")
        seconds = self.robot.runs.simulate_s if duration_s is None else duration_s
        if not self.dt_s <= seconds < math.inf:
            raise ArgumentError(
                f"duration_s: {seconds:g} s, expected at least one sampling time, {self.dt_s:g} s"
            )
        return closed_loop(self.config, self._prediction, x0, seconds, self._solver)

    def __repr__(self) -> str:
        settings = self.config.controller
        way = "" if settings.reprojection else ", without reprojection"
        return (
            f"Controller({self.robot.name} robot, cost {settings.cost}, plans with {self._name}"
            f"{way}, {settings.horizon} steps of {settings.dt_s:g} s, {self._solver.description})"
        )

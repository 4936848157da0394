"""A parking run: the controller drives the robot to a goal with a model."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

import lcmtypes
from koopman_lab.bus.channels import MOCAP_POSE, MPC_STATE
from koopman_lab.bus.processes import build
from koopman_lab.config.schema import LabConfig
from koopman_lab.data.decode import SessionLog
from koopman_lab.files import write_csv
from koopman_lab.geometry.planar import ORIGIN, Pose
from koopman_lab.robots.table import robot_type
from offboard.desk.results import ParkEnd, ParkOutcome, ParkSummary, Spread
from offboard.lab.run_folder import RunFolder
from offboard.lab.session_kind import Progress, SessionKind
from offboard.lab.session_runner import run_session
from offboard.lab.session_watch import START_LIMIT_S

if TYPE_CHECKING:
    from koopman_lab.bus.realtime import Listener
    from koopman_lab.predictors.predictor import PredictionModel
    from offboard.controller.node import ControllerNode

AFTER_LIMIT_S = 10.0
"""Time beyond the controller's own limit for waiting and braking."""
TRAJECTORY = "trajectory.csv"


class Parking(SessionKind["ControllerNode", ParkOutcome]):
    """One drive to a goal (paper, sections 4 and 5.4).

    Parameters
    ----------
    model
        The model file, which a controller in its own process reads.
    goal
        In the inertial frame (m, m, rad).
    start
        Where the robot is placed before (m, m, rad); None to leave it.
    prediction
        What a controller in this process predicts with, where the file has been read already.
    """

    node_name = "controller"
    doing, unit = "parking", "s at most"
    state_channel = MPC_STATE
    outcome_type = ParkOutcome

    def __init__(
        self,
        model: Path,
        goal: Pose = ORIGIN,
        start: Pose | None = None,
        prediction: PredictionModel | None = None,
    ) -> None:
        self.model, self.goal, self.start = model, goal, start
        self._prediction = prediction

    def require_possible(self, config: LabConfig) -> None:
        """Refuse what the controller would refuse, before anything is started or written.

        Nothing is compiled for it: the solver is made once, by the controller.

        Raises
        ------
        ModelError
            If the model is of another robot or another sampling time than the configuration, or
            was read here and must not drive
            (:func:`~koopman_lab.evaluation.fit_to_drive.require_fit_to_drive`).
        ConfigError
            If the weights do not fit the cost.
        LabStateError
            If the robot must not be sent to the goal.
        """
        from koopman_lab.mpc.receding_horizon import planning_problem
        from offboard.desk.floor import require_on_floor

        planning_problem(self._prediction_model(config), config)
        require_on_floor(self.goal, config.floor)
        if self.start is not None:
            require_on_floor(self.start, config.floor, "start")

    def make_node(self, config: LabConfig) -> ControllerNode:
        """Return the controller.

        Raises
        ------
        LabError
            As :meth:`require_possible`, or if the model file is missing or damaged.
        """
        node: ControllerNode = build(
            self.node_name, config, self._prediction_model(config), self.goal
        )
        return node

    def outcome(self, node: ControllerNode, missed_deadlines: int) -> ParkOutcome:
        """Return how the run ended, by the controller."""
        return node.outcome(missed_deadlines)

    def arguments(self) -> tuple[str | Path, ...]:
        """Return the arguments of `klab run controller`; its process may have another folder."""
        degrees = (self.goal.x1, self.goal.x2, math.degrees(self.goal.theta))
        return "--model", self.model.absolute(), "--goal", *map(str, degrees)

    def limit_s(self, config: LabConfig) -> float:
        """Return the virtual time (s) in which the controller has ended by itself."""
        return config.controller.time_limit_s + AFTER_LIMIT_S

    def progress(self, node: ControllerNode, elapsed_s: float, config: LabConfig) -> Progress:
        """Return how much of the controller's time limit has passed."""
        del node
        limit_s = config.controller.time_limit_s
        return Progress(min(elapsed_s, limit_s), limit_s)

    def progress_reported(
        self, state: lcmtypes.mpc_state_t, elapsed_s: float, config: LabConfig
    ) -> Progress:
        """Return how much of the controller's time limit has passed."""
        del state
        limit_s = config.controller.time_limit_s
        return Progress(min(round(elapsed_s), limit_s), limit_s)

    def has_begun(self, state: lcmtypes.mpc_state_t) -> bool:
        """Return whether the controller drives."""
        return state.state != state.WAIT

    def waits_for(self, config: LabConfig) -> str:
        """Return what the controller needs to begin."""
        del config
        return "camera frames, wheel odometry, a logger, and an onboard loop without emergency stop"

    def start_limit_s(self, config: LabConfig) -> float:
        """Return the time (s) in which the controller must have begun; it may have to compile."""
        return self.limit_s(config) + START_LIMIT_S

    def _prediction_model(self, config: LabConfig) -> PredictionModel:
        from koopman_lab.evaluation.fit_to_drive import require_fit_to_drive
        from koopman_lab.predictors.table import load_model, prediction_of

        if self._prediction is None:
            model = load_model(self.model)
            require_fit_to_drive(model, config)
            self._prediction = prediction_of(model, config.controller)
        return self._prediction


def park(
    config: LabConfig, folder: RunFolder, listener: Listener | None, session: Parking
) -> ParkSummary:
    """Park once and leave trajectory, figure and summary; a run that is interrupted keeps its log.

    Parameters
    ----------
    config
        The lab.
    folder
        Takes the files.
    listener
        Of this process; None for lockstep.
    session
        What is parked where, and with which model.

    Raises
    ------
    LabError
        If the run cannot be made.
    """
    from koopman_lab.studies.closed_loop import columns

    outcome = run_session(session, config, folder, listener).outcome
    robot = robot_type(config.robot.kind)
    write_csv(folder.path / TRAJECTORY, columns(robot), outcome.trajectory)
    log = SessionLog(folder.log)
    summary = ParkSummary(
        **outcome.model_dump(include=ParkEnd.model_fields.keys() | {"missed_deadlines"}),
        model=str(session.model.absolute()),
        cost=config.controller.cost,
        solve_ms=_spread(outcome.solve_ms),
        pose_age_ms=_spread(outcome.pose_age_ms),
        mocap_messages_lost=log.channels[MOCAP_POSE.name(config.robot.name)].lost,
        clock_error_s=log.clock_error_s(),
        trajectory=TRAJECTORY,
    )
    folder.write_summary(config, summary.model_dump())
    # Last: what was measured must not hang on whether it can be drawn.
    _draw_path(folder, outcome)
    return summary


def _draw_path(folder: RunFolder, outcome: ParkOutcome) -> None:
    """Draw the path of the driving steps if there are any."""
    from koopman_lab.figures.path_figure import Curve, draw_paths

    if outcome.trajectory:
        steps = np.array(outcome.trajectory)
        curve = Curve("", steps[:, 0], steps[:, 1:4], steps[:, -1])
        draw_paths(folder.path / "path", [curve])


def _spread(values: Sequence[float]) -> Spread:
    if not values:
        return Spread(p50=None, p99=None, max=None)
    p50, p99, largest = np.percentile(values, [50, 99, 100]).tolist()
    return Spread(p50=p50, p99=p99, max=largest)

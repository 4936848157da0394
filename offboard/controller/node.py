"""Ties the controller to the bus."""

from __future__ import annotations

import contextlib
import time
from pathlib import Path

import lcmtypes
from koopman_lab.bus import channels
from koopman_lab.bus.age import is_current
from koopman_lab.bus.node import Port
from koopman_lab.config.schema import LabConfig
from koopman_lab.errors import UsageError
from koopman_lab.geometry.planar import ORIGIN, Pose
from koopman_lab.mpc.receding_horizon import receding_horizon
from koopman_lab.mpc.solver import Solver
from koopman_lab.predictors.predictor import PredictionModel
from koopman_lab.predictors.table import load_prediction
from koopman_lab.units import US_PER_S
from offboard.controller.controller import Controller
from offboard.controller.controller_step import Inputs, State
from offboard.controller.delay import LoopDelay
from offboard.controller.step_report import TrajectoryPoint, mpc_state, trajectory_rows
from offboard.desk.commander import Commands, SessionInfo
from offboard.desk.drive_inputs import DriveInputs
from offboard.desk.guard import Guard
from offboard.desk.motion_check import MARKER_M
from offboard.desk.results import ParkOutcome


class ControllerNode:
    """Listens to poses, wheels and who is alive; commands the robot and speaks MPC_STATE.

    Parameters
    ----------
    config
        The lab.
    model
        Predicts the robot, or the model file to load.
    goal
        Goal pose in the inertial frame.
    solver
        Made before for the same model and configuration; None to make it here.

    Raises
    ------
    ModelError
        If the model cannot be used with this configuration.
    """

    name = "controller"

    def __init__(
        self,
        config: LabConfig,
        model: PredictionModel | Path,
        goal: Pose = ORIGIN,
        solver: Solver | None = None,
    ) -> None:
        prediction = load_prediction(model, config.controller) if isinstance(model, Path) else model
        optimiser = receding_horizon(prediction, config, solver=solver)
        self.controller = Controller(config, optimiser, goal)
        self.robot = prediction.robot
        """Which robot is driven."""
        self.marker_offset = prediction.marker_offset
        """Pose of the tracked frame on the robot, as the model knows it."""
        self.solver_description = optimiser.solver_description
        """What solves, in words for a person."""
        self.solve_ms: list[float] = []
        self.pose_age_ms: list[float] = []
        """Of the newest measured pose when the command acts, by driving step."""
        self.trajectory: list[TrajectoryPoint] = []
        self._config = config
        self._port: Port | None = None
        self._delay = LoopDelay(config)

    def attach(self, port: Port) -> None:
        """Register channels and timers."""
        self._port = port
        self._commands = Commands(port, self._config, self.name)
        timeout_s = self._config.controller.tracking_timeout_s
        self._inputs = DriveInputs(
            port,
            self._config,
            Guard(self._config, timeout_s, lever_m=MARKER_M),
            self._commands,
            marker_offset=self.marker_offset,
        )
        SessionInfo(port, self._config, "park")
        port.subscribe(channels.GOAL, self._on_goal)
        port.subscribe(channels.TIME_SYNC, self._on_time_sync)
        port.every(1.0 / self._config.controller.dt_s, self._on_tick)

    def close(self) -> None:
        """Give the robot up; the motor loop brings it to rest."""
        if self._port is not None:
            self._commands.release(self._port.now_us())

    def outcome(self, missed_deadlines: int = 0) -> ParkOutcome:
        """Return how the run ended, or where it stands; who runs the node counts the deadlines."""
        drive, now_us = self.controller, self._port.now_us() if self._port else 0
        return ParkOutcome(
            parked=drive.state is State.PARKED,
            state=drive.state.name,
            reason=drive.reason,
            final_pose=drive.pose(),
            goal=drive.goal,
            marker_offset=self.marker_offset,
            duration_s=drive.duration_s(now_us),
            pauses=tuple(drive.pauses),
            steps=len(self.trajectory),
            solver=self.solver_description,
            solve_ms=tuple(self.solve_ms),
            pose_age_ms=tuple(self.pose_age_ms),
            missed_deadlines=missed_deadlines,
            trajectory=trajectory_rows(self.robot, self.trajectory),
        )

    def _on_goal(self, message: lcmtypes.goal_t) -> None:
        assert self._port is not None  # by attach
        now_us = self._port.now_us()
        # A goal in a replayed log is not meant for the robot of today.
        lifetime_us = self._config.motor_loop.command_lifetime_s * US_PER_S
        if not is_current(message.utime, now_us, lifetime_us):
            return
        goal = Pose(message.goal_x1_m, message.goal_x2_m, message.goal_theta_rad)
        with contextlib.suppress(UsageError):  # MPC_STATE goes on to name the old one
            self.controller.move_goal(goal, now_us)

    def _on_time_sync(self, message: lcmtypes.time_sync_t) -> None:
        self._delay.set_round_trip(message.round_trip_us)

    def _on_tick(self, tick_us: int) -> None:
        del tick_us
        assert self._port is not None  # by attach
        now_us, began_s = self._port.now_us(), time.perf_counter()
        inputs = self._inputs
        inputs.step(now_us, driving=self.controller.state is State.DRIVING)
        frames = () if inputs.frame is None else (inputs.frame,)
        seen = Inputs(frames, inputs.wheels, inputs.interlock, self._delay.estimate_s())
        outputs = self.controller.step(seen, now_us)
        solve_ms = (time.perf_counter() - began_s) * 1e3
        sent_us = self._port.now_us()
        if outputs.holds:
            self._commands.send(outputs.u, sent_us)
        else:
            self._commands.release_if_held(sent_us)
        if outputs.state is State.DRIVING:
            self.solve_ms.append(solve_ms)
            age_us = sent_us - (outputs.pose_utime or sent_us)
            self.pose_age_ms.append(age_us * 1e-3 + self._delay.after_sending_s * 1e3)
            state = tuple(map(float, outputs.state_in_goal_frame))
            self.trajectory.append(TrajectoryPoint(sent_us, state, outputs.u, outputs.value))
        self._delay.add_step_duration((sent_us - now_us) / US_PER_S)
        # In lockstep time on the wall means nothing, and logs are the same byte by byte.
        published_ms = 0.0 if self._port.virtual else solve_ms
        report = mpc_state(outputs, self.controller.goal, published_ms, sent_us)
        self._port.publish(channels.MPC_STATE, report)
        if outputs.finished:
            self._port.finish()

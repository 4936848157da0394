"""Functions that make something go wrong in a driving lab, one for each kind of fault."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import lcmtypes
from koopman_lab.bus.channels import (
    ESTOP,
    FAULT,
    GOAL,
    MOCAP_POSE,
    WHEEL_STATE,
    command_channel,
)
from koopman_lab.config.simulation import Fault
from koopman_lab.emulation.faults import fault_message
from koopman_lab.errors import ModelError, UsageError
from koopman_lab.geometry.planar import Pose
from koopman_lab.predictors.nominal import NominalPrediction
from koopman_lab.robots.table import ROBOTS, robot_type
from koopman_lab.units import US_PER_S
from offboard.bench.faults.failing_solver import FailingSolver
from offboard.bench.faults.stage import Stage
from offboard.controller.node import ControllerNode
from offboard.desk.floor import require_on_floor
from offboard.desk.goal_message import goal_message
from offboard.sampler.node import SamplerNode

CONTROLLER, BEGIN = lcmtypes.velocity_command_t.CONTROLLER, lcmtypes.velocity_command_t.BEGIN


@dataclass(frozen=True)
class Inject:
    """A strike that sends a fault."""

    fault: Fault

    def __call__(self, stage: Stage) -> None:
        """Send it."""
        stage.lab.publish(FAULT, fault_message(self.fault, stage.lab.now_us))


def kill(name: str) -> Callable[[Stage], None]:
    """Return a strike that lets a node die."""
    return lambda stage: stage.kill(name)


def estop(stage: Stage) -> None:
    """Press the emergency stop."""
    message = lcmtypes.estop_t()
    message.utime, message.engaged = stage.lab.now_us, True
    stage.lab.publish(ESTOP, message)


def command(u: float, age_s: float = 0.0) -> Callable[[Stage], None]:
    """Return a strike that sends one more command in the controller's name."""

    def send(stage: Stage) -> None:
        utime = stage.lab.now_us - round(age_s * US_PER_S)
        robot = robot_type(stage.config.robot.kind)
        channel = command_channel(robot)
        message = channel.type()
        message.utime, message.commander, message.intent = utime, CONTROLLER, BEGIN
        robot.commanded().encode(message, [u, *[0.0] * (robot.input_dim - 1)])
        stage.lab.publish(channel, message)

    return send


def send_to(goal: Pose) -> Callable[[Stage], None]:
    """Return a strike that moves the goal, and keeps what `klab goal` would say of it."""

    def strike(stage: Stage) -> None:
        try:
            require_on_floor(goal, stage.config.floor)
        except UsageError as error:
            stage.message = str(error)
        stage.lab.publish(GOAL, goal_message(goal, stage.lab.now_us))

    return strike


def wrong_model(stage: Stage) -> None:
    """Start a second controller, with a model of the other robot."""
    other = next(robot for robot in ROBOTS if robot.name != stage.config.robot.kind)
    prediction = NominalPrediction(other.name, stage.config.controller.dt_s)
    try:
        stage.join(ControllerNode(stage.config, prediction))
    except ModelError as error:
        stage.message = str(error)


def no_number(stage: Stage) -> None:
    """Send a frame whose pose is no number, and says nothing of it."""
    frame = lcmtypes.mocap_pose_t()
    frame.utime, frame.tracking_valid = stage.lab.now_us, True
    frame.x1_m = frame.x2_m = frame.theta_rad = math.nan
    stage.lab.publish(MOCAP_POSE, frame)


def no_wheels(stage: Stage) -> None:
    """Let the board say nothing more of its wheels."""
    stage.killable["onboard"].muted.add(WHEEL_STATE.suffix)


def failing_solver(times: float) -> Callable[[Stage], None]:
    """Return a strike that lets the solver fail a number of times."""

    def strike(stage: Stage) -> None:
        assert isinstance(stage.commander, ControllerNode)  # by the scenario's activity
        optimiser = stage.commander.controller.optimiser
        optimiser.solver = FailingSolver(optimiser.solver, times)

    return strike


def second_commander(stage: Stage) -> None:
    """Start a calibration while the controller parks."""
    stage.join(SamplerNode(stage.config))

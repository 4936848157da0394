"""The controller on the bus, with the real plant, motor loop and logger in lockstep."""

import math

import lcm
import pytest
from tests_support import lab_of

import lcmtypes
from koopman_lab.bus import channels
from koopman_lab.config.load import load_config, parse_config
from koopman_lab.errors import ModelError
from koopman_lab.geometry.planar import Pose, compose, relative_to
from koopman_lab.predictors.nominal import NominalPrediction
from offboard.controller.node import ControllerNode
from offboard.logger.node import LoggerNode
from onboard.motor_loop.node import OnboardNode
from onboard.plant.node import PlantNode

GOAL = Pose(0.3, -0.2, 1.0)
START = {
    "kinematic": Pose(0.0, 0.5, 0.0),
    "dynamic": Pose(-1.1, -0.53, math.radians(-42.68)),
}


class Lab:
    """The whole lab in lockstep, the robot placed at ``start`` relative to the goal."""

    def __init__(self, folder, robot="kinematic", start=None, overrides=()):
        pose = compose(GOAL, start or START[robot])
        placed = [f"simulation.plant.initial_pose={list(pose)}", *overrides]
        self.config = load_config(robot=robot, overrides=placed)
        self.log = folder / "session.lcm"
        self.plant = PlantNode(self.config)
        prediction = NominalPrediction(robot, self.config.controller.dt_s)
        self.controller = ControllerNode(self.config, prediction, GOAL)
        onboard, logger = OnboardNode(self.config), LoggerNode(self.config, self.log)
        self.lockstep = lab_of(self.config, self.plant, onboard, logger, self.controller)

    def run(self, limit_s=30.0):
        finished = self.lockstep.run(limit_s)
        self.lockstep.close()
        return finished

    def messages(self, channel):
        name = channel.name(self.config.robot.name)
        log = lcm.EventLog(str(self.log), "r")
        found = [channel.type.decode(event.data) for event in log if event.channel == name]
        log.close()
        return found


@pytest.mark.parametrize("robot", ["kinematic", "dynamic"])
def test_the_lab_parks(tmp_path, robot):
    lab = Lab(tmp_path, robot)
    assert lab.run()
    outcome = lab.controller.outcome()
    assert outcome.parked
    assert outcome.state == "PARKED"
    assert 2.0 < outcome.duration_s < 25.0
    assert outcome.steps == len(outcome.solve_ms) == len(lab.controller.trajectory)
    assert outcome.steps == pytest.approx(outcome.duration_s / 0.05, abs=1)
    assert all(ms > 0.0 for ms in outcome.solve_ms)
    truth = relative_to(GOAL, lab.plant.plant.pose)
    for pose in (outcome.final_pose, truth):
        assert abs(pose.x1) <= 0.03
        assert abs(pose.x2) <= 0.01
        assert abs(pose.theta) <= math.radians(5.0)

    reports = lab.messages(channels.MPC_STATE)
    driving = [m for m in reports if m.state == lcmtypes.mpc_state_t.DRIVING]
    assert reports[-1].state == lcmtypes.mpc_state_t.PARKED
    assert tuple(reports[0].goal) == GOAL
    for report, point in zip(driving, lab.controller.trajectory, strict=True):
        assert (report.utime, report.value_function) == (point.utime, point.value)
        assert report.state_in_goal_frame[: len(point.state)] == point.state
        assert not any(report.state_in_goal_frame[len(point.state) :])
        assert (report.inputs, report.u[:2]) == (2, point.u)
        assert not any(report.u[2:])
        assert report.solve_ms == 0.0
        assert report.horizon == lab.config.controller.horizon + 1
        assert 0 < report.pose_age_us < 20_000
    commanded = channels.VELOCITY_CMD if robot == "kinematic" else channels.ACCELERATION_CMD
    commands = lab.messages(commanded)
    kind = lcmtypes.mpc_state_t
    held = [m.utime for m in reports if m.state in (kind.WAIT, kind.DRIVING)]
    assert [m.utime for m in commands[: len(held)]] == held
    release = commands[0].RELEASE
    assert all(m.intent == release for m in commands[len(held) :])
    assert len(commands) > len(held)
    assert {m.commander for m in commands} == {lcmtypes.velocity_command_t.CONTROLLER}
    info = lab.messages(channels.SESSION_INFO)[0]
    assert info.activity == "park"
    assert parse_config(info.config_yaml, "SESSION_INFO") == lab.config


def test_two_runs_leave_the_same_bytes(tmp_path):
    logs = []
    for name in ("first", "second"):
        (tmp_path / name).mkdir()
        lab = Lab(tmp_path / name, overrides=["controller.horizon=20"])
        lab.run(1.5)
        logs.append(lab.log.read_bytes())
    assert logs[0] == logs[1]


def test_an_emergency_stop_fails_the_run_and_it_does_not_go_on_after_the_release(tmp_path):
    lab = Lab(tmp_path, overrides=["controller.horizon=20"])
    lab.lockstep.run(1.0)
    assert lab.controller.outcome().state == "DRIVING"
    for engaged in (True, False):
        stop = lcmtypes.estop_t()
        stop.engaged = engaged
        lab.lockstep.publish(channels.ESTOP, stop)
        lab.lockstep.run(0.4)
    lab.run(3.0)
    outcome = lab.controller.outcome()
    assert (outcome.parked, outcome.state) == (False, "FAILED")
    assert "onboard" in outcome.reason
    assert lab.plant.plant.body_velocity() == (0.0, 0.0)


def test_without_a_logger_the_robot_is_not_moved():
    config = load_config(robot="kinematic")
    plant = PlantNode(config)
    node = ControllerNode(config, NominalPrediction("kinematic", 0.05), GOAL)
    lockstep = lab_of(config, plant, OnboardNode(config), node)
    assert not lockstep.run(1.0)
    outcome = node.outcome()
    assert (outcome.state, outcome.reason) == ("WAIT", "waits: logger silent")
    assert (outcome.steps, outcome.duration_s) == (0, 0.0)
    assert plant.plant.body_velocity() == (0.0, 0.0)
    lockstep.close()


def test_the_state_is_the_robots_where_the_model_knows_of_the_markers():
    offset = Pose(0.05, -0.03, 0.2)
    overrides = [
        f"simulation.cameras.marker_offset={list(offset)}",
        "simulation.plant.initial_pose=[0.5, 0.1, 3.0]",
    ]
    config = load_config(robot="kinematic", preset="ideal", overrides=overrides)
    prediction = NominalPrediction("kinematic", 0.05)
    prediction.marker_offset = offset
    plant = PlantNode(config)
    node = ControllerNode(config, prediction, GOAL)
    lockstep = lab_of(config, plant, OnboardNode(config), node)
    nonsense = lcmtypes.mocap_pose_t()
    nonsense.tracking_valid, nonsense.theta_rad = True, math.inf
    lockstep.publish(channels.MOCAP_POSE, nonsense)
    lockstep.run(0.2)
    expected = relative_to(GOAL, plant.plant.pose)
    assert node.outcome().final_pose == pytest.approx(tuple(expected), abs=1e-12)
    lockstep.close()


def test_a_model_file_that_is_not_there_is_named(tmp_path):
    with pytest.raises(ModelError, match=r"absent\.npz"):
        ControllerNode(load_config(robot="kinematic"), tmp_path / "absent.npz")

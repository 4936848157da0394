"""A session whose own program cannot go on ends in words: somebody speaks for it, or it slept."""

import pytest
from tests_support import lab_of

import lcmtypes
from koopman_lab.bus import channels
from koopman_lab.bus.commanders import commander_number
from koopman_lab.config.load import load_config
from koopman_lab.geometry.planar import Pose
from koopman_lab.predictors.nominal import NominalPrediction
from koopman_lab.robots.table import robot_type
from offboard.controller.node import ControllerNode
from offboard.logger.node import LoggerNode
from offboard.reference.node import ReferenceNode
from offboard.reference.shapes import Shape
from offboard.sampler.node import SamplerNode
from onboard.motor_loop.node import OnboardNode
from onboard.plant.node import PlantNode

PERIOD_S = 0.05
AFTER_S = 1.0
"""For the last status messages, the ramp, and the farewells."""
COMMANDS = lcmtypes.velocity_command_t


def controller(config):
    prediction = NominalPrediction(config.robot.kind, config.controller.dt_s)
    return ControllerNode(config, prediction, Pose(1.0, 0.3, 0.0))


NODES = {
    "controller": controller,
    "sampler": SamplerNode,
    "reference": lambda config: ReferenceNode(config, Shape.SQUARE),
}


class Lab:
    def __init__(self, folder, name, robot):
        self.config = load_config(robot=robot)
        self.node = NODES[name](self.config)
        self.plant, self.onboard = PlantNode(self.config), OnboardNode(self.config)
        logger = LoggerNode(self.config, folder / "session.lcm")
        self.lab = lab_of(self.config, self.plant, self.onboard, logger, self.node)
        self.number = commander_number(name, 0)
        self.command = robot_type(robot).commanded()
        self.channel = channels.command_channel(robot_type(robot))
        self.sequence = 1_000_000

    def drive(self):
        """Run until the robot is driven."""
        for _ in range(1000):
            self.lab.run(PERIOD_S)
            if abs(self.onboard.loop.setpoint.v) > 0.05:
                return
        pytest.fail("does not drive")

    def forge(self, u, intent):
        message = self.channel.type()
        message.utime, message.commander, message.intent = self.lab.now_us, self.number, intent
        message.sequence = self.sequence
        self.sequence += 1
        self.command.encode(message, u)
        self.lab.send(self.channel.name("R1"), message.encode())

    def ends_within(self, seconds):
        """Run; return whether the node ended by itself."""
        return self.lab.run(seconds)

    def reason(self):
        self.lab.close()
        return self.node.outcome().reason


@pytest.mark.parametrize("robot", ["kinematic", "dynamic"])
@pytest.mark.parametrize("name", NODES)
def test_a_stranger_under_the_holders_number_ends_the_session_in_words(tmp_path, name, robot):
    """Its numbers run ahead, so that those of the holder seem to be of before."""
    lab = Lab(tmp_path, name, robot)
    lab.drive()
    limit_s = lab.config.commander.refused_limit_s
    for _ in range(round((limit_s + AFTER_S) / PERIOD_S)):
        lab.forge((0.0, 0.1), COMMANDS.BEGIN)
        if lab.ends_within(PERIOD_S):
            break
    refused = lab.onboard.loop.arbiter.counts.refused["order"]
    assert refused > 0
    # The stranger is gone: whatever is left to be said is soon.
    assert lab.lab.finished or lab.ends_within(AFTER_S)
    assert "under this one's number" in lab.reason()


@pytest.mark.parametrize("name", NODES)
def test_a_session_that_slept_ends_in_words_and_the_robot_stays_where_it_stands(tmp_path, name):
    lab = Lab(tmp_path, name, "kinematic")
    lab.drive()
    # As a process that was stopped: its clock goes on, and nothing of it runs.
    asleep = lab.node._inputs._wakefulness
    asleep._stepped_us -= 30_000_000
    speeds = []
    for _ in range(round(3.0 / PERIOD_S)):
        if lab.ends_within(PERIOD_S):
            break
        speeds.append(abs(lab.onboard.loop.setpoint.v))
    assert "stood still for 30." in lab.reason()
    assert speeds == sorted(speeds, reverse=True), "it only brakes"
    assert speeds[-1] == 0.0

"""The robot that agents drive is the one of a lab in lockstep, step for step."""

import numpy as np
import pytest

from koopman_lab.bus import channels
from koopman_lab.bus.lockstep import Lockstep
from koopman_lab.config.load import load_config
from koopman_lab.geometry.planar import Pose, move_along_arc, wrap_angle
from offboard.desk.commander import Commands
from offboard.rl.driven_robot import DrivenRobot
from onboard.motor_loop.node import OnboardNode
from onboard.plant.simulated_robot import SimulatedRobot

START = Pose(0.3, -0.2, 2.0)
EXACTLY_PLACED = [
    *("placement.position_m=0", "placement.angle_rad=0"),
    f"simulation.plant.initial_pose={list(START)}",
]
STALLED = "simulation.faults=[{kind: motor_stalled, at_s: 1.0, duration_s: 0.03, wheel: left}]"


class Witness:
    """Commands one input after the other, and keeps where the robot is when it does."""

    name = "controller"

    def __init__(self, config, inputs):
        self._config, self._inputs, self.seen = config, list(inputs), []

    def attach(self, port):
        self._port = port
        self._commands = Commands(port, self._config, self.name)
        port.subscribe(channels.PLANT_TRUTH, self._on_truth)
        port.every(1.0 / self._config.controller.dt_s, self._on_tick)

    def close(self):
        pass

    def _on_truth(self, truth):
        self._truth = (truth.x1_m, truth.x2_m, truth.theta_rad)
        self._speed = (truth.v_m_per_s, truth.omega_rad_per_s)

    def _on_tick(self, tick_us):
        self.seen.append((*self._truth, *self._speed))
        if self._inputs:
            self._commands.send(self._inputs.pop(0), tick_us)
        else:
            self._port.finish()


@pytest.mark.parametrize("overrides", [(), ("motor_loop.rate_hz=50",), (STALLED,)])
@pytest.mark.parametrize("preset", ["lab", "harsh", "ideal"])
@pytest.mark.parametrize("robot", ["kinematic", "dynamic"])
def test_it_moves_as_in_a_lab_in_lockstep(robot, preset, overrides):
    config = load_config(
        robot=robot,
        preset=preset,
        overrides=[*EXACTLY_PLACED, "bus.heartbeat_rate_hz=1", *overrides],
    )
    largest = np.array(config.controller.u_max)
    inputs = np.random.default_rng(4).uniform(-largest, largest, (60, 2))
    inputs[30:40] = 0.0
    witness = Witness(config, inputs.tolist())
    lab = Lockstep(config)
    for node in (SimulatedRobot(config), OnboardNode(config), witness):
        lab.add(node)
    assert lab.run(10.0)
    driven = DrivenRobot(config, np.random.default_rng(0), START)
    seen = [(*driven.pose, *driven.velocity)]
    for number, u in enumerate(inputs.tolist(), start=1):
        driven.apply(u, round(number * config.controller.dt_s * 1e6))
        seen.append((*driven.pose, *driven.velocity))
    np.testing.assert_array_equal(seen, witness.seen)
    assert np.ptp(np.array(seen)[:, 0]) > 0.01


@pytest.mark.parametrize("u", [(0.3, 0.0), (0.2, 0.9), (-0.2, -1.2)])
def test_the_ideal_robot_follows_the_nominal_equations_from_the_next_tick_on(u):
    config = load_config(robot="kinematic", preset="ideal")
    driven = DrivenRobot(config, np.random.default_rng(0), START)
    for number in range(1, 21):
        driven.apply(u, number * 50_000)
    driving_s = 1.0 - 1.0 / config.motor_loop.rate_hz
    expected = move_along_arc(START, u[0] * driving_s, u[1] * driving_s)
    assert driven.pose[:2] == pytest.approx(expected[:2], abs=1e-9)
    assert wrap_angle(driven.pose.theta - expected.theta) == pytest.approx(0.0, abs=1e-9)
    assert driven.velocity == pytest.approx(u)

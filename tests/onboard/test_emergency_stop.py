"""How soon the robot stands after the emergency stop: the motors' own braking, nothing else.

Standing is what the motor loop takes for it: no encoder count within a tick of 10 ms, which with
2400 counts a turn and wheels of 30 mm is slower than 8 mm/s.
"""

import math
from itertools import pairwise

import pytest
from tests_support import Script, lab_of

import lcmtypes
from koopman_lab.bus import channels
from koopman_lab.config.load import load_config
from onboard.motor_loop.node import OnboardNode
from onboard.plant.node import PlantNode

TICK_US = 10_000
STEADY_S = 1.5
WATCHED_S = 0.3
ON_THE_WAY_S = 0.005
"""By radio, and to the plant; the tick is waited for besides."""


class RobotWatchNode:
    """Notes duties and counts."""

    name = "onlooker"

    def __init__(self):
        self.duties, self.counts = [], []

    def attach(self, port):
        port.subscribe(channels.MOTOR_CMD, self.duties.append)
        port.subscribe(channels.ENCODER, self.counts.append)

    def close(self):
        pass


def stop_at(v, preset):
    """Stop a robot that drives straight; return when motors are at zero and it stands (s)."""
    config = load_config(preset=preset)
    onlooker, robot = RobotWatchNode(), (PlantNode(config), OnboardNode(config))
    lab = lab_of(config, *robot, Script(config, (v, 0.0)), onlooker)
    lab.run(STEADY_S)
    pressed_us = lab.now_us
    onlooker.duties.clear()
    onlooker.counts.clear()
    message = lcmtypes.estop_t()
    message.utime, message.engaged = pressed_us, True
    lab.publish(channels.ESTOP, message)
    lab.run(WATCHED_S)
    zero = [duty.utime for duty in onlooker.duties if duty.left_duty == duty.right_duty == 0.0]
    counts = [(c.utime, c.left_count, c.right_count) for c in onlooker.counts]
    stood = [before[0] for before, after in pairwise(counts) if before[1:] == after[1:]]
    return (zero[0] - pressed_us) * 1e-6, (stood[0] - pressed_us) * 1e-6


@pytest.mark.parametrize("preset", ["lab", "harsh"])
@pytest.mark.parametrize("v", [0.05, 0.1, 0.15, 0.3, 0.4, 0.6])
def test_motors_are_at_zero_in_the_next_tick_and_the_robot_stands_soon_after(v, preset):
    zero_s, stood_s = stop_at(v, preset)
    assert zero_s <= ON_THE_WAY_S + TICK_US * 1e-6
    # Within 100 ms of the message from slow speeds, and from full speed with its kinetic energy.
    assert stood_s <= (0.1 if v <= 0.15 else 0.16)


def test_braking_lasts_as_long_as_motor_and_friction_say():
    """Speed falls towards minus what friction would drive it to, with the lag of the motor."""
    config = load_config()
    motor, body = config.simulation.plant.motor, config.simulation.plant.body
    back_emf = motor.gear_ratio * motor.torque_constant_n_m_per_a
    damping = back_emf**2 / motor.resistance_ohm + motor.viscous_friction_n_m_s_per_rad
    radius_m = config.robot.wheel_radius_m
    inertia = (
        body.wheel_inertia_kg_m2
        + motor.gear_ratio**2 * motor.rotor_inertia_kg_m2
        + 0.5 * body.mass_kg * radius_m**2
    )
    friction_m_per_s = radius_m * sum(motor.coulomb_friction_n_m) / 2 / damping
    for v in (0.15, 0.4, 0.6):
        expected_s = inertia / damping * math.log(1.0 + v / friction_m_per_s)
        zero_s, stood_s = stop_at(v, "lab")
        assert stood_s - zero_s == pytest.approx(expected_s, abs=0.02)

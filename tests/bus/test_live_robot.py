"""A replayed log never moves a robot that is alive, whatever plays it."""

from pathlib import Path

import pytest

import lcmtypes
from koopman_lab.bus import channels
from koopman_lab.bus.lockstep import Lockstep
from koopman_lab.config.load import load_config
from koopman_lab.config.robot_side import Fault
from koopman_lab.emulation.faults import fault_message
from koopman_lab.emulation.wire import SILENCE_US, Wire
from koopman_lab.eventlog.eventlog import read_events
from koopman_lab.geometry.planar import Pose
from koopman_lab.units import US_PER_S
from offboard.desk.placing import reset_message
from onboard.motor_loop.loop import State
from onboard.motor_loop.node import OnboardNode
from onboard.plant.node import PlantNode

LOG = Path(__file__).parents[1] / "data" / "reference" / "calibration.lcm"
NOW_US = 1_800_000_000 * US_PER_S
TICK_US = 10_000


def test_a_wire_takes_its_stream_and_not_an_old_one():
    wire = Wire()
    for k in range(10):
        assert wire.takes(NOW_US + k * TICK_US, k * TICK_US)
        assert not wire.takes(k, k * TICK_US + 1)


def test_a_wire_follows_a_sender_whose_clock_was_set():
    wire = Wire()
    assert wire.takes(NOW_US, 0)
    assert wire.takes(NOW_US - US_PER_S // 2, TICK_US), "back by less than any log's age"
    assert wire.takes(NOW_US + 3600 * US_PER_S, 2 * TICK_US)
    back = [wire.takes(NOW_US + k * TICK_US, (2 + k) * TICK_US) for k in range(1, 8)]
    assert back == [k * TICK_US >= SILENCE_US for k in range(1, 8)]


@pytest.mark.parametrize("offset_s", [0.25, -30.0])
@pytest.mark.parametrize("speed", [1, 3])
def test_a_session_replayed_onto_a_live_robot_does_not_move_it(offset_s, speed):
    """Commands are stale, and the wire knows its own motor duties and encoder counts."""
    config = load_config(overrides=[f"clock.offset_s={offset_s}"])
    lab, plant, onboard = Lockstep(config, NOW_US), PlantNode(config), OnboardNode(config)
    lab.add(plant)
    lab.add(onboard)
    lab.run(1.0)
    where, begin_us = plant.plant.pose, lab.now_us
    commands = 0
    for event in read_events(LOG):
        commands += event.channel == channels.VELOCITY_CMD.name("R1")
        at_us, name = begin_us + event.timestamp_us // speed, event.channel
        lab.push(at_us, 4, lambda data, _, name=name: lab.send(name, data), event.data)
    assert commands > 100
    for _ in range(120 // speed):
        lab.run(0.1)
        assert plant.plant.pose == where
        assert onboard.loop.state is State.REST
    counts = onboard.loop.arbiter.counts
    assert counts.accepted == 0
    assert counts.refused["stale"] >= 0.95 * commands  # the radio loses a few


def test_a_release_from_a_log_does_not_undo_the_emergency_stop():
    config = load_config()
    lab, onboard = Lockstep(config, NOW_US), OnboardNode(config)
    lab.add(onboard)
    lab.run(0.5)

    def say(engaged, age_s):
        for _ in range(5):
            message = lcmtypes.estop_t()
            message.utime, message.engaged = lab.now_us - round(age_s * US_PER_S), engaged
            lab.publish(channels.ESTOP, message)
            lab.run(0.05)

    say(engaged=True, age_s=0.0)
    say(engaged=True, age_s=3600.0)
    say(engaged=False, age_s=3599.0)
    assert onboard.loop.state is State.ESTOP
    say(engaged=False, age_s=0.0)
    assert onboard.loop.state is State.REST


def test_a_hand_or_a_fault_from_a_log_does_nothing_to_the_robot_of_today():
    lab, plant = Lockstep(load_config(), NOW_US), PlantNode(load_config())
    lab.add(plant)
    lab.add(OnboardNode(load_config()))
    lab.run(0.5)
    where = plant.plant.pose

    def say(age_s):
        utime = lab.now_us - round(age_s * US_PER_S)
        lab.publish(channels.FAULT, fault_message(Fault(kind="battery_low"), utime))
        lab.publish(channels.PLANT_RESET, reset_message(Pose(1.0, 0.5, 0.0), utime))
        lab.run(0.2)

    for age_s in (3600.0, 6.0, -6.0):
        say(age_s)
        assert plant.plant.pose == where
        assert plant.plant.battery_v() > 7.0
    say(0.0)
    assert plant.plant.pose.x1 > 0.9
    assert plant.plant.battery_v() < 6.5

"""A replayed log never moves a robot that is alive, whatever plays it.

All of it holds for a simulated robot, whose board has a radio and a clock of its own, and for a
real one, whose program has the bus itself, with a driver that speaks ENCODER.
"""

from pathlib import Path

import pytest
from tests_support import lab_of

import lcmtypes
from koopman_lab.bus import channels
from koopman_lab.bus.lockstep import Lockstep
from koopman_lab.config.load import load_config
from koopman_lab.config.simulation import Fault
from koopman_lab.emulation.faults import fault_message
from koopman_lab.eventlog.eventlog import read_events
from koopman_lab.geometry.planar import Pose
from koopman_lab.units import US_PER_S
from offboard.desk.placing import reset_message
from onboard.motor_loop.loop import State
from onboard.motor_loop.node import OnboardNode
from onboard.plant.node import PlantNode

LOG = Path(__file__).parents[1] / "data" / "reference" / "calibration.lcm"
NOW_US = 1_800_000_000 * US_PER_S
BOARDS = ("simulated", "real")


def robot(board, *overrides):
    """Return a lab, its plant and its motor loop; the plant drives the motors of the real one."""
    config = load_config(overrides=overrides)
    plant, onboard = PlantNode(config), OnboardNode(config)
    if board == "simulated":
        return lab_of(config, plant, onboard, start_us=NOW_US), plant, onboard
    lab = Lockstep(config, NOW_US)
    lab.add(plant)
    lab.add(onboard)
    return lab, plant, onboard


def replay(lab, speed=1):
    """Send a session again from now on; return how many commands it holds."""
    commands, begin_us = 0, lab.now_us
    for event in read_events(LOG):
        commands += event.channel == channels.VELOCITY_CMD.name("R1")
        at_us, name = begin_us + event.timestamp_us // speed, event.channel
        lab.push(at_us, 4, lambda data, _, name=name: lab.send(name, data), event.data)
    assert commands > 100
    return commands


@pytest.mark.parametrize(
    ("board", "offset_s"), [("simulated", 0.25), ("simulated", -30.0), ("real", 0.0)]
)
@pytest.mark.parametrize("speed", [1, 3])
def test_a_session_replayed_onto_a_live_robot_does_not_move_it(board, offset_s, speed):
    """Commands are stale, and both ends of the wire know whom they follow."""
    lab, plant, onboard = robot(board, f"simulation.clock.offset_s={offset_s}")
    lab.run(1.0)
    where = plant.plant.pose
    commands = replay(lab, speed)
    for _ in range(120 // speed):
        lab.run(0.1)
        assert plant.plant.pose == where
        assert onboard.loop.state is State.REST
    counts = onboard.loop.arbiter.counts
    assert counts.accepted == 0
    assert counts.refused["stale"] >= 0.95 * commands  # a simulated radio loses a few


@pytest.mark.parametrize("board", BOARDS)
def test_a_robot_that_is_switched_on_into_a_replay_is_not_moved_by_it(board):
    """Its own hardware may speak later than the log: it is followed from its first word."""
    lab, plant, onboard = robot(board)
    replay(lab)
    lab.run(1.0)
    where = plant.plant.pose
    for _ in range(100):
        lab.run(0.1)
        assert plant.plant.pose == where
        assert onboard.loop.state is State.REST


@pytest.mark.parametrize("board", BOARDS)
def test_a_release_from_a_log_does_not_undo_the_emergency_stop(board):
    lab, _, onboard = robot(board)
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


@pytest.mark.parametrize("board", BOARDS)
def test_a_hand_or_a_fault_from_a_log_does_nothing_to_the_robot_of_today(board):
    lab, plant, _ = robot(board)
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


@pytest.mark.parametrize("board", BOARDS)
def test_only_a_simulated_board_obeys_a_fault_of_its_radio_or_its_clock(board):
    lab, _, onboard = robot(board)
    lab.run(0.5)
    for kind in ("radio_cut", "clock_jump"):
        lab.publish(channels.FAULT, fault_message(Fault(kind=kind), lab.now_us))
    lab.run(0.2)
    jumped = onboard._port.now_us() - lab.now_us > 5 * US_PER_S
    assert jumped == (board == "simulated")

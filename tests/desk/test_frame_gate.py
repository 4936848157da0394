"""Which frames are believed, and what is said of those that are not."""

import math

import pytest

from koopman_lab.config.load import load_config
from koopman_lab.geometry.planar import REST, Pose, Velocity
from offboard.desk.frame_gate import SETTLED_S, FrameGate, jump_text
from offboard.desk.interlock import Cause
from offboard.desk.measurements import Frame

CONFIG = load_config(robot="kinematic")
HOUR_US = 3_600_000_000
PLACE = Pose(0.2, 0.1, 0.5)
NOW_US = 1_700_000_000_000_000


@pytest.mark.parametrize(
    ("utime", "says"),
    [
        (NOW_US + 30_000_000, "30.0 s ahead of this computer's clock"),
        (NOW_US - HOUR_US, "3600 s behind this computer's clock"),
        (NOW_US // 1000, "stamps in ms instead of us"),
        (NOW_US // 1_000_000, "stamps in s instead of us"),
        (NOW_US * 1000, "stamps in ns instead of us"),
    ],
)
def test_a_stamp_that_is_wrong_is_said_with_its_unit_or_by_how_much(utime, says):
    gate = FrameGate(CONFIG, 0.1)
    assert gate.update([Frame(utime, Pose(0, 0, 0), True)], NOW_US, REST, driving=False) is None
    assert says in gate.interlock(NOW_US).reason


def test_a_jump_is_said_in_metres_and_degrees():
    assert jump_text(Pose(1.0, 1.0, 3.1), Pose(1.3, 0.6, -3.1)) == "jumped by 0.50 m and 5 deg"


def settled(rolled=REST, steps=20):
    gate = FrameGate(CONFIG, 0.1)
    for k in range(steps):
        now_us = NOW_US + k * 50_000
        gate.update([Frame(now_us, PLACE, True)], now_us, rolled, driving=True)
    return gate, now_us


@pytest.mark.parametrize(
    ("rolled", "frozen"),
    [
        (REST, False),
        (Velocity(0.005, 0.0), True),
        (Velocity(0.0, 0.02), True),
        (Velocity(0.0005, 0.002), False),
    ],
)
def test_a_pose_that_stays_the_same_to_the_last_bit_while_wheels_turn_is_frozen(rolled, frozen):
    gate, now_us = settled(rolled)
    assert gate.frozen is frozen
    interlock = gate.interlock(now_us)
    assert (interlock is not None) is frozen
    if frozen:
        assert interlock.cause is Cause.TRACKING
        # Standing still does not thaw it; another pose does.
        gate.update([Frame(now_us + 1, Pose(0.2, 0.1, 0.5), True)], now_us, REST, driving=False)
        assert gate.frozen
        gate.update([Frame(now_us + 2, Pose(0.2, 0.1, 0.5001), True)], now_us, REST, driving=False)
        assert gate.interlock(now_us) is None


def test_a_robot_is_believed_to_be_somewhere_once_it_was_seen_there_for_a_while():
    for steps in range(1, 12):
        gate, now_us = settled(steps=steps)
        assert (gate.interlock(now_us) is None) is ((steps - 1) * 0.05 >= SETTLED_S - 1e-9)


def test_a_jump_in_a_drive_is_a_contradiction():
    gate, now_us = settled()
    there = Pose(1.2, 0.1, 0.5)
    for k in range(1, 6):
        frame = Frame(now_us + k * 50_000, there, True)
        gate.update([frame], frame.utime, REST, driving=True)
    interlock = gate.interlock(frame.utime)
    assert (interlock.cause, interlock.lasting) == (Cause.MOTION, True)
    assert "jumped by 1.00 m and 0 deg" in interlock.reason


@pytest.mark.parametrize("bad", [math.nan, math.inf])
def test_what_is_no_number_is_never_believed(bad):
    gate, now_us = settled()
    frame = Frame(now_us + 1, Pose(0.2, bad, 0.5), True)
    assert gate.update([frame], now_us, REST, driving=True) is None
    assert gate.update(
        [frame, Frame(now_us + 1, Pose(0.2, 0.1, 0.5), True)], now_us, REST, driving=True
    )

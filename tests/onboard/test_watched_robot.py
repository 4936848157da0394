"""The plant's cameras in a process of their own, beside its motors in another."""

import math

import pytest
from hostile.times import HOSTILE
from tests_support import Eye, Script

import lcmtypes
from koopman_lab.bus import channels
from koopman_lab.bus.hardware import driver, mocap
from koopman_lab.bus.lockstep import Lockstep
from koopman_lab.config.load import load_config
from koopman_lab.config.simulation import Fault
from koopman_lab.emulation.faults import fault_message
from onboard.motor_loop.node import OnboardNode
from onboard.plant.cameras.watched_robot import OLDEST_TRUTH_US, WatchedRobot


def driven(seconds):
    config, eye = load_config(robot="kinematic", preset="ideal"), Eye()
    lab = Lockstep(config)
    robot = driver("plant", config)
    for node in (robot, mocap("plant", config), OnboardNode(config)):
        lab.add(node)
    lab.add(Script(config, (0.3, 0.8)))
    lab.add(eye)
    lab.run(seconds)
    return lab, eye


def test_they_see_the_robot_of_the_other_process_at_their_own_rate():
    _, eye = driven(2.0)
    assert abs(len(eye.frames) - 480) <= 1
    truth = {message.utime: message for message in eye.truths}
    together = [(f, truth[f.utime]) for f in eye.frames if f.utime in truth and f.tracking_valid]
    assert len(together) >= 30, "every 50 ms the ticks of both coincide"
    for frame, true in together:
        assert math.hypot(frame.x1_m - true.x1_m, frame.x2_m - true.x2_m) < 1e-9
        assert abs(frame.theta_rad - true.theta_rad) < 1e-9
    x1, x2 = eye.frames[-1].x1_m, eye.frames[-1].x2_m
    assert math.hypot(x1, x2) > 0.3


def test_an_occlusion_of_the_plant_hides_the_robot():
    lab, eye = driven(0.5)
    lab.publish(channels.FAULT, fault_message(Fault(kind="occlusion", duration_s=0.2), lab.now_us))
    lab.run(0.5)
    lost = [frame.utime for frame in eye.frames if not frame.tracking_valid and frame.utime > 5000]
    assert abs(len(lost) - 48) <= 3
    assert eye.frames[-1].tracking_valid


def hidden(robot, now_us):
    """Look at the robot; return whether nothing can be seen."""
    at_us, _, unseen = robot.look(now_us)
    assert at_us == now_us
    return unseen


def test_who_is_told_nothing_or_nothing_new_sees_nothing():
    robot, truth = WatchedRobot(), lcmtypes.plant_truth_t()
    assert hidden(robot, 0)
    truth.utime = 1_000_000
    robot.take(truth, truth.utime)
    for age_us in (-OLDEST_TRUTH_US, 0, OLDEST_TRUTH_US):
        assert not hidden(robot, truth.utime + age_us)
    for age_us in (-OLDEST_TRUTH_US - 1, OLDEST_TRUTH_US + 1):
        assert hidden(robot, truth.utime + age_us)


@pytest.mark.parametrize("what", [what for what in HOSTILE if "just inside" not in what])
def test_news_of_another_time_hide_no_robot_and_hand_out_no_frames(what):
    robot, called, now_us = WatchedRobot(), [], 1_700_000_000_000_000
    robot.after_tick.append(called.append)
    for utime in (now_us, HOSTILE[what](now_us)):
        truth = lcmtypes.plant_truth_t()
        truth.utime = utime
        robot.take(truth, now_us)
    assert called == [now_us]
    assert not hidden(robot, now_us)

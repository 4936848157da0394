"""The state relative to the goal: continued angles, unusable frames, old wheels."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from koopman_lab.config.load import load_config
from koopman_lab.geometry.planar import Pose, Velocity, compose, wrap_angle
from koopman_lab.robots.table import robot_type
from offboard.controller.estimate import StateEstimator, oldest_wheels_s
from offboard.desk.measurements import Frame, WheelSpeeds

FINITE = st.floats(-3.0, 3.0)
ORIGIN = Pose(0.0, 0.0, 0.0)


CONFIG = {robot: load_config(robot=robot) for robot in ("kinematic", "dynamic")}


def make(robot="kinematic", goal=ORIGIN):
    model = robot_type(robot)
    return StateEstimator(CONFIG[robot], goal, lambda x, u: model.step(x, u, 0.05))


@given(
    goal=st.builds(Pose, FINITE, FINITE, FINITE),
    first=st.floats(-3.0, 3.0),
    turns=st.lists(st.floats(-3.0, 3.0), max_size=12),
)
def test_the_angle_is_continued_without_jumps_through_any_turning(goal, first, turns):
    estimator, theta = make(goal=goal), first
    for k, turn in enumerate([0.0, *turns]):
        theta += turn
        seen = compose(goal, Pose(0.1, 0.2, theta))
        assert -math.pi < seen.theta <= math.pi
        estimator.update([Frame(k, seen, True)], None, k)
        np.testing.assert_allclose(estimator.state(k), [0.1, 0.2, theta], atol=1e-9)


def test_the_first_angle_lies_within_a_half_turn_of_the_goal():
    estimator = make(goal=Pose(0.0, 0.0, 3.0))
    estimator.update([Frame(0, Pose(0.0, 0.0, -3.0), True)], None, 0)
    assert estimator.state(0)[2] == pytest.approx(wrap_angle(-6.0))


def test_the_newest_usable_frame_counts():
    estimator = make()
    assert estimator.state(0) is None
    estimator.update([Frame(5, Pose(9.0, 9.0, 0.0), False)], None, 10)
    estimator.update([Frame(6, Pose(math.nan, 0.0, 0.0), True)], None, 10)
    assert estimator.state(10) is None
    frames = [
        Frame(20, Pose(1.0, 0.0, 0.0), True),
        Frame(30, Pose(2.0, 0.0, 0.0), True),
        Frame(25, Pose(3.0, 0.0, 0.0), True),
        Frame(40, Pose(4.0, 0.0, 0.0), False),
    ]
    estimator.update(frames, None, 50)
    assert estimator.state(50)[0] == 2.0
    assert estimator.frame.utime == estimator.measured_us == 30


def test_between_measurements_the_model_goes_on_with_the_applied_inputs():
    estimator, model = make(), robot_type("kinematic")
    x = np.array([0.1, 0.2, 0.3])
    estimator.update([Frame(0, Pose(*x), True)], None, 0)
    assert estimator.is_measured
    for k, u in enumerate(([0.2, 0.5], [0.1, -0.5]), start=1):
        estimator.apply(np.array(u), (k - 1) * 50_000)
        estimator.update([], None, k * 50_000)
        assert not estimator.is_measured
        x = model.step(x, u, 0.05)
        np.testing.assert_allclose(estimator.state(k * 50_000), x, atol=1e-12)
    estimator.update([Frame(150_000, Pose(0.5, 0.0, 0.0), True)], None, 150_000)
    assert estimator.is_measured
    np.testing.assert_array_equal(estimator.state(150_000), [0.5, 0.0, 0.0])
    # The last input goes on until the command that is now computed acts.
    moved = estimator.state(170_000) - [0.5, 0.0, 0.0]
    whole = model.step(np.array([0.5, 0.0, 0.0]), [0.1, -0.5], 0.05) - [0.5, 0.0, 0.0]
    np.testing.assert_allclose(moved, 0.4 * whole, atol=1e-15)


def test_speeds_are_carried_from_the_wheels_window_to_the_frame_and_on_to_the_command():
    estimator = make("dynamic")
    estimator.apply(np.array([0.4, -1.0]), 0)
    estimator.apply(np.array([-0.2, 0.5]), 50_000)
    wheels = WheelSpeeds(30_000, Velocity(0.1, 0.2))
    estimator.update([Frame(60_000, Pose(0.0, 0.0, 0.0), True)], wheels, 65_000)
    v, omega = 0.1 + 0.02 * 0.4 - 0.01 * 0.2, 0.2 - 0.02 * 1.0 + 0.01 * 0.5
    np.testing.assert_allclose(estimator.state(60_000)[3:], [v, omega], atol=1e-15)
    np.testing.assert_allclose(
        estimator.state(80_000)[3:], [v - 0.02 * 0.2, omega + 0.02 * 0.5], atol=1e-15
    )


def test_the_second_order_robot_needs_young_wheel_odometry():
    estimator, config = make("dynamic"), CONFIG["dynamic"]
    oldest_us = round(oldest_wheels_s(config) * 1e6)
    pose = Pose(0.1, 0.2, 0.3)
    estimator.update([Frame(1, pose, True)], None, 1)
    assert estimator.state(1) is None
    wheels = WheelSpeeds(1000, Velocity(0.4, -0.2))
    estimator.update([Frame(2, pose, True)], wheels, 1000 + oldest_us)
    np.testing.assert_allclose(estimator.state(2), [0.1, 0.2, 0.3, 0.4, -0.2], atol=1e-15)
    estimator.update([Frame(3, Pose(9.0, 9.0, 9.0), True)], wheels, 1001 + oldest_us)
    assert estimator.state(2)[0] == 0.1
    assert estimator.measured_us == 2


def test_odometry_that_is_not_a_number_is_not_taken():
    estimator = make("dynamic")
    estimator.update([], WheelSpeeds(0, Velocity(math.nan, 0.0)), 0)
    assert estimator.wheels is None

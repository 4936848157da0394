from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from koopman_lab.data.processing import (
    States,
    body_velocities,
    margin,
    moving_average,
    pair,
    states,
)
from koopman_lab.data.segments import Run, Segment
from koopman_lab.errors import DataError
from koopman_lab.geometry.planar import wrap_angle
from koopman_lab.robots.dynamic import DYNAMIC
from koopman_lab.robots.kinematic import KINEMATIC
from koopman_lab.robots.robot_type import Quantity

RATE = 240.0
RUN = Run(0, 1, (0.2, 0.0), 0, 10_000_000)
WINDOWS = st.integers(1, 60)


def camera_times(count):
    return np.round(np.arange(count) * 1e6 / RATE).astype(np.int64)


def segment(utime, x1, x2, theta):
    return Segment(RUN, utime, np.column_stack([x1, x2, wrap_angle(np.asarray(theta, float))]))


@given(WINDOWS, st.floats(-3, 3), st.floats(-3, 3))
def test_constants_and_ramps_pass_the_moving_average_unchanged(window, offset, slope):
    steps = np.arange(150.0)
    values = np.column_stack([np.full(150, offset), offset + slope * steps])
    smooth = moving_average(values, window)
    kept = values[margin(window) : len(values) - margin(window)]
    assert smooth == pytest.approx(kept, abs=1e-11)


def test_an_odd_window_is_the_plain_mean_and_an_even_one_the_mean_of_its_two_positions():
    values = np.random.default_rng(0).normal(size=(9, 1))
    assert moving_average(values, 3)[0] == pytest.approx(values[:3].mean())
    first, second = values[:4].mean(), values[1:5].mean()
    assert moving_average(values, 4)[0] == pytest.approx((first + second) / 2)


@given(WINDOWS)
def test_the_average_takes_whole_windows_only(window):
    needed = 1 + 2 * margin(window)
    assert len(moving_average(np.ones((needed - 1, 2)), window)) == 0
    assert moving_average(np.ones((needed, 2)), window) == pytest.approx(np.ones((1, 2)))


@given(st.floats(-0.5, 0.5), st.floats(0.05, 3), st.floats(-np.pi, np.pi))
def test_velocities_on_a_circle_are_those_of_its_chords(v, omega, theta0):
    utime = (np.arange(50) * 5_000).astype(np.int64)
    theta = theta0 + omega * utime / 1e6
    poses = np.column_stack([v / omega * np.sin(theta), -v / omega * np.cos(theta), theta])
    forward, lateral, yaw = body_velocities(utime, poses).T
    half_angle = omega * 0.005
    assert forward == pytest.approx(np.full(48, v * np.sin(half_angle) / half_angle), abs=1e-9)
    assert lateral == pytest.approx(np.zeros(48), abs=1e-9)
    assert yaw == pytest.approx(np.full(48, omega), abs=1e-9)


def test_differences_use_the_real_times():
    utime = np.array([0, 1_000, 5_000, 6_000])
    poses = np.column_stack([utime / 1e6, 0.0 * utime, 0.0 * utime])
    assert body_velocities(utime, poses)[:, 0] == pytest.approx([1.0, 1.0])


def test_sliding_sideways_is_lateral_velocity():
    utime = camera_times(20)
    poses = np.column_stack([0.0 * utime, 0.3 * utime / 1e6, 0.0 * utime])
    assert body_velocities(utime, poses)[:, 1] == pytest.approx(np.full(18, 0.3))


@given(WINDOWS)
def test_states_of_a_straight_acceleration_are_exact(window):
    utime = camera_times(200)
    t = utime / 1e6
    found = states(segment(utime, 0.1 * t**2, 0 * t, 0 * t), DYNAMIC, window)
    cut = 1 + margin(window)
    assert np.array_equal(found.utime_us, utime[cut:-cut])
    kept = t[cut:-cut]
    # Stamps are whole microseconds, so the mean of their times is off by less than one.
    assert found.x[:, 3] == pytest.approx(0.2 * kept, abs=1e-6)
    assert found.x[:, 0] == pytest.approx(0.1 * kept**2, abs=1e-15)
    assert np.abs(found.x[:, [1, 2, 4]]).max() == 0.0


def test_a_segment_shorter_than_window_and_difference_gives_nothing():
    utime = camera_times(42)
    t = utime / 1e6
    assert len(states(segment(utime, t, t, t), DYNAMIC, 40).x) == 0
    assert len(states(segment(camera_times(43), *[camera_times(43) / 1e6] * 3), DYNAMIC, 40).x) == 1


def test_the_kinematic_robot_keeps_every_pose_as_it_is():
    utime = camera_times(10)
    noisy = np.random.default_rng(0).normal(size=(3, 10))
    found = states(segment(utime, *noisy), KINEMATIC, 40)
    assert np.array_equal(found.x[:, :2], noisy[:2].T)
    assert np.array_equal(found.utime_us, utime)


def test_angles_are_continued_through_the_jump():
    utime = camera_times(1000)
    theta = 3.0 + 2.0 * utime / 1e6
    found = states(segment(utime, 0 * utime, 0 * utime, theta), DYNAMIC, 10)
    assert np.diff(found.x[:, 2]).max() < 0.01
    assert found.x[:, 4] == pytest.approx(np.full(len(found.x), 2.0), abs=1e-9)


@given(st.floats(-30, 30), st.floats(-3, 3))
def test_x_lies_in_the_half_open_circle_and_y_goes_on_from_there(theta0, omega):
    utime = camera_times(100)
    theta = theta0 + omega * utime / 1e6
    found = pair(States(utime, np.column_stack([theta] * 3), np.zeros(0)), 0.05, RATE)
    assert np.all(found.X[:, 2] > -np.pi)
    assert np.all(found.X[:, 2] <= np.pi)
    assert found.Y[:, 2] - found.X[:, 2] == pytest.approx(np.full(88, 0.05 * omega), abs=1e-5)
    assert found.X[:, 2] == pytest.approx(wrap_angle(theta[:88]), abs=1e-12)


def numbered_states(utime):
    count = np.arange(len(utime), dtype=float)
    return States(utime, np.column_stack([count, 0 * count, 0 * count]), np.zeros(0))


@pytest.mark.parametrize("frames", [1, 12, 24])
def test_a_multiple_of_the_frame_time_pairs_frames(frames):
    found = pair(numbered_states(camera_times(60)), frames / RATE, RATE)
    assert len(found.X) == 60 - frames
    assert np.array_equal(found.Y[:, 0], found.X[:, 0] + frames)
    assert np.array_equal(found.start_us, camera_times(60)[: 60 - frames])


def test_frames_are_matched_by_time_and_not_by_count():
    utime = np.delete(camera_times(60), 30)
    found = pair(numbered_states(utime), 0.05, RATE)
    assert len(found.X) == 46
    successor = {int(x): int(y) for x, y in zip(found.X[:, 0], found.Y[:, 0], strict=True)}
    assert successor[17] == 29
    assert 18 not in successor
    assert successor[19] == 30


@given(st.floats(0.004, 0.2))
def test_other_steps_are_interpolated_and_ramps_come_out_exact(dt_s):
    utime = camera_times(100)
    t = utime / 1e6
    found = pair(States(utime, np.column_stack([t, 2 * t, 0.1 * t]), np.zeros(0)), dt_s, RATE)
    frames = dt_s * RATE
    if abs(frames - round(frames)) > 0.01:
        assert found.Y[:, 0] - found.X[:, 0] == pytest.approx(
            np.full(len(found.X), dt_s), abs=1e-12
        )
    assert len(found.X) >= 99 - np.ceil(frames)


def test_a_stretch_shorter_than_dt_gives_no_pair():
    for count in (0, 1, 12):
        found = pair(numbered_states(camera_times(count)), 0.05, RATE)
        assert found.X.shape == found.Y.shape == (0, 3)
        assert pair(numbered_states(camera_times(count)), 0.051, RATE).X.shape == (0, 3)


def test_states_that_no_camera_sees_are_refused_by_name():
    robot = replace(DYNAMIC, states=(*DYNAMIC.states, Quantity("battery", "V")))
    utime = camera_times(100)
    with pytest.raises(DataError, match="robot dynamic: the cameras do not tell its states batt"):
        states(segment(utime, *[utime / 1e6] * 3), robot, 10)


def test_speeds_stand_where_the_robot_says():
    swapped = replace(
        DYNAMIC, states=(*DYNAMIC.states[:3], *DYNAMIC.states[:2:-1]), speeds_at=(4, 3)
    )
    utime = camera_times(100)
    poses = segment(utime, *[utime / 1e6] * 3)
    there, here = states(poses, DYNAMIC, 10).x, states(poses, swapped, 10).x
    np.testing.assert_array_equal(here[:, [4, 3]], there[:, 3:])
    np.testing.assert_array_equal(here[:, :3], there[:, :3])

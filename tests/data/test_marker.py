"""The marker offset, found on paths that are known exactly."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import lcmtypes
from koopman_lab.data.marker import (
    FEWEST,
    SETTLING_S,
    find_marker,
    marker_offset,
    without_offset,
)
from koopman_lab.data.message_arrays import native_dtype
from koopman_lab.data.segments import Run, Segment
from koopman_lab.geometry.planar import ORIGIN, Pose, compose, relative_to, wrap_angle

RATE = 240.0
OFFSET = Pose(0.012, -0.007, 0.03)
STATE = lcmtypes.sampler_state_t


def segment(robot, offset, rng=None, position_m=0.0002, angle_rad=0.00087):
    """Return what cameras report of the robot's poses (k, 3), with noise if there is an rng."""
    theta = robot[:, 2]
    seen = robot[:, 0] + 1j * robot[:, 1] + np.exp(1j * theta) * complex(offset.x1, offset.x2)
    poses = np.column_stack([seen.real, seen.imag, wrap_angle(theta + offset.theta)])
    if rng is not None:
        poses += rng.normal(size=poses.shape) * [position_m, position_m, angle_rad]
        poses[:, 2] = wrap_angle(poses[:, 2])
    utime = np.rint(np.arange(len(poses)) * 1e6 / RATE).astype(np.int64)
    return Segment(Run(0, 1, (0.0, 0.0), 0, 0), utime, poses)


def rotation(start, turn_rad, frames=200):
    theta = start[2] + np.linspace(0.0, turn_rad, frames)
    return np.column_stack([np.full(frames, start[0]), np.full(frames, start[1]), theta])


def drive(start, length_m, bend_rad=0.0, frames=300):
    """Return poses on an arc, without sliding."""
    share = np.linspace(0.0, 1.0, frames)
    theta = start[2] + bend_rad * share
    step = length_m / (frames - 1) * np.exp(0.5j * (theta[1:] + theta[:-1]))
    way = np.concatenate([[0.0], np.cumsum(step)])
    return np.column_stack([start[0] + way.real, start[1] + way.imag, theta])


def paths(rng, count):
    """Return rotations and drives from random places, with random turns and bends."""
    starts = rng.uniform([0, -0.7, -np.pi], [1.5, 0.7, np.pi], (count, 3))
    turns = rng.uniform(0.6, 3.0, count) * rng.choice([-1, 1], count)
    rotations = [rotation(s, t) for s, t in zip(starts, turns, strict=True)]
    drives = [drive(s, rng.uniform(0.2, 1.0), rng.uniform(-0.1, 0.1)) for s in starts]
    return rotations, drives


def session(offset, count, rng=None, seed=1):
    rotations, drives = paths(np.random.default_rng(seed), count)
    return [segment(r, offset, rng) for r in rotations], [segment(d, offset, rng) for d in drives]


@given(st.floats(-0.1, 0.1), st.floats(-0.1, 0.1), st.floats(-3.1, 3.1))
def test_exact_poses_give_the_offset_exactly(ahead, left, turn):
    found = marker_offset(*session(Pose(ahead, left, turn), FEWEST))
    assert found.offset == pytest.approx((ahead, left, turn), abs=1e-12)
    assert found.error == pytest.approx((0.0, 0.0, 0.0), abs=1e-12)
    assert (found.rotations, found.drives, found.reason) == (FEWEST, FEWEST, "")


def test_noise_moves_the_offset_by_as_much_as_its_standard_error_says():
    count, trials = 12, 60
    found = [
        marker_offset(*session(OFFSET, count, np.random.default_rng(k))) for k in range(trials)
    ]
    off = np.array([np.subtract(f.offset, OFFSET) for f in found])
    errors = np.array([f.error for f in found])
    # Sixty draws know a standard deviation to a tenth, and a mean to an eighth of it.
    assert off.std(axis=0) == pytest.approx(errors.mean(axis=0), rel=0.4)
    assert np.all(np.abs(off.mean(axis=0)) < 0.4 * off.std(axis=0))
    assert np.all(errors.max(axis=0) < [5e-5, 5e-5, 2e-3])


def test_a_rotation_that_goes_wrong_widens_the_error_until_nothing_is_said():
    rotations, drives = session(OFFSET, 12)
    wrong = rotations[0].poses.copy()
    for push_m, known in ((0.0, True), (0.002, True), (0.2, False)):
        wrong[:, 0] = rotations[0].poses[:, 0] + np.linspace(0.0, push_m, len(wrong))
        found = marker_offset([rotations[0]._replace(poses=wrong), *rotations[1:]], drives)
        assert (found.offset is not None) == known
        if known:
            off = np.abs(np.subtract(found.offset, OFFSET))
            assert np.all(off <= 3.0 * np.array(found.error) + 1e-12)
    assert found.error is None
    assert found.reason.startswith("known only to")


def test_too_little_rotation_or_driving_says_nothing_and_why():
    rotations, drives = session(OFFSET, FEWEST)
    short = [segment(rotation((0.1, 0.2, 0.3), 0.4), OFFSET) for _ in range(50)]
    standing = [segment(drive((0.1, 0.2, 0.3), 0.05), OFFSET) for _ in range(50)]
    for given_rotations, given_drives, counts, reason in [
        ([], drives, (0, 0), "0 rotations in place, needs 4"),
        (rotations[1:] + short, drives, (FEWEST - 1, 0), "3 rotations in place, needs 4"),
        (rotations, drives[1:] + standing, (FEWEST, FEWEST - 1), "3 drives, needs 4"),
    ]:
        found = marker_offset(given_rotations, given_drives)
        assert found.offset is found.error is None
        assert ((found.rotations, found.drives), found.reason) == (counts, reason)
    # Among enough others, short ones change nothing.
    assert marker_offset(rotations + short, drives + standing).rotations == FEWEST


@given(st.floats(-1, 1), st.floats(-1, 1), st.floats(-3.1, 3.1))
def test_taking_an_offset_out_is_the_inverse_of_putting_it_in(ahead, left, turn):
    offset, robot = Pose(ahead, left, turn), rotation((0.4, -0.3, 3.0), 6.0, 40)
    poses = without_offset(segment(robot, offset).poses, offset)
    assert poses[:, :2] == pytest.approx(robot[:, :2], abs=1e-12)
    assert np.exp(1j * poses[:, 2]) == pytest.approx(np.exp(1j * robot[:, 2]), abs=1e-12)
    assert np.all(np.abs(poses[:, 2]) <= math.pi)
    # The controller does the same to one pose at a time.
    one = compose(compose(Pose(*robot[0]), offset), relative_to(offset, ORIGIN))
    assert poses[0] == pytest.approx(tuple(one), abs=1e-12)


def messages(stretches, gap_s=0.2):
    """Return states and frames of stretches (phase, robot's poses), one behind the other."""
    frames, states, time_s = [], [], 0.0
    for phase, robot in stretches:
        for number, at_s in (phase, time_s), (STATE.SETTLE, time_s + len(robot) / RATE):
            states.append((round(at_s * 1e6), len(states), number))
        seen = segment(robot, OFFSET)
        times = seen.utime_us + round(time_s * 1e6)
        numbers = range(len(frames), len(frames) + len(times))
        frames += zip(times, numbers, *seen.poses.T, strict=True)
        time_s += len(robot) / RATE + gap_s
    made = np.zeros(len(states), native_dtype(STATE))
    for row, (utime, sequence, phase) in zip(made, states, strict=True):
        row["utime"], row["sequence"], row["phase"] = utime, sequence, phase
    camera = np.zeros(len(frames), native_dtype(lcmtypes.mocap_pose_t))
    for row, (utime, sequence, x1, x2, theta) in zip(camera, frames, strict=True):
        row["utime"], row["sequence"] = utime, sequence
        row["x1_m"], row["x2_m"], row["theta_rad"] = x1, x2, theta
    camera["tracking_valid"] = True
    return made, camera


def test_a_session_shows_the_offset_where_it_turns_and_drives_and_nowhere_else():
    rng = np.random.default_rng(5)
    rotations, drives = paths(rng, FEWEST)
    stretches = []
    for turn, way in zip(rotations, drives, strict=True):
        # Half a second in which the robot still rolls out does not count.
        rolling = drive(turn[0], 0.1, 0.2, round(SETTLING_S * RATE))
        stretches.append((STATE.ROTATE_TO_TARGET, np.vstack([rolling, turn])))
        stretches.append((STATE.DRIVE, way))
        stretches.append((STATE.BASIS, drive(turn[0], 0.5, 2.0)))
    found = find_marker(*messages(stretches), RATE)
    assert found.offset == pytest.approx(tuple(OFFSET), abs=1e-9)
    assert (found.rotations, found.drives) == (FEWEST, FEWEST)
    without_drives = [row for row in stretches if row[0] != STATE.DRIVE]
    assert find_marker(*messages(without_drives), RATE).reason == "0 drives, needs 4"

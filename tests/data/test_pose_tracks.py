"""Poses that one body cannot have gone through do not belong together."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from koopman_lab.data.pose_tracks import SLACK_M, SLACK_RAD, jumps, reach_of, tracks
from koopman_lab.geometry.reach import Reach

RATE_HZ, V, OMEGA = 240.0, 0.6, 3.0
REACH = Reach(V, OMEGA, SLACK_M[0], SLACK_RAD[0])


def times(count, begin_us=0):
    return begin_us + np.rint(np.arange(count) * 1e6 / RATE_HZ).astype(np.int64)


def walk(count, seed):
    """Return poses of a body that changes speed and direction, never beyond its limits."""
    rng = np.random.default_rng(seed)
    knots = rng.uniform(-1.0, 1.0, (count // 60 + 2, 2)) * (V, OMEGA)
    speeds = np.array([np.interp(np.arange(count), 60 * np.arange(len(knots)), k) for k in knots.T])
    theta = rng.uniform(-np.pi, np.pi) + np.cumsum(speeds[1]) / RATE_HZ
    x1 = np.cumsum(speeds[0] * np.cos(theta)) / RATE_HZ
    x2 = np.cumsum(speeds[0] * np.sin(theta)) / RATE_HZ
    wrapped = np.remainder(theta + np.pi, 2.0 * np.pi) - np.pi
    return np.column_stack([x1, x2, wrapped])


@given(st.integers(0, 500), st.lists(st.integers(0, 599), max_size=40), st.integers(0, 2**40))
def test_a_body_within_its_limits_is_one_track(seed, lost, begin_us):
    """With the noise of preset `harsh`, and whichever frames are lost."""
    rng = np.random.default_rng(seed)
    poses = walk(600, seed) + rng.standard_normal((600, 3)) * (0.0006, 0.0006, 0.0026)
    kept = np.setdiff1d(np.arange(600), lost)
    utime = times(600, begin_us)[kept]
    tracked = tracks(utime, poses[kept], reach_of(utime, poses[kept], V, OMEGA))
    assert len(set(tracked.number.tolist())) == 1
    assert (tracked.covered_from == -1).all()


@given(
    st.integers(0, 100),
    st.integers(100, 400),
    st.integers(1, 100),
    st.tuples(st.floats(0.3, 9.0), st.floats(0.3, 9.0), st.floats(-3.0, 3.0)),
)
def test_what_a_longer_track_interrupts_is_covered_by_it(seed, begin, length, elsewhere):
    poses = walk(600, seed)
    stop = begin + length
    poses[begin:stop] = poses[begin - 1] + elsewhere
    tracked = tracks(times(600), poses, REACH)
    inside = np.zeros(600, bool)
    inside[begin:stop] = True
    np.testing.assert_array_equal(tracked.covered_from >= 0, inside)
    assert (tracked.covered_from[inside] == begin - 1).all()


def test_whoever_is_away_for_long_may_have_been_carried():
    """Nobody knows which of two long tracks is right, and nothing is left out."""
    poses = walk(1200, 4)
    poses[400:800] += (2.0, 0.0, 0.0)
    tracked = tracks(times(1200), poses, REACH)
    assert (tracked.covered_from == -1).all()
    assert len(set(tracked.number.tolist())) == 3


def test_a_pause_ends_a_track_and_no_memory_is_taken_for_it():
    """A session that goes on years later, by its stamps."""
    utime = np.concatenate([times(300), times(300, 10**16)])
    tracked = tracks(utime, np.zeros((600, 3)), REACH)
    assert sorted(set(tracked.number.tolist())) == [0, 1]
    assert (tracked.covered_from == -1).all()


def test_a_jump_is_what_no_speed_makes():
    utime = np.array([0, 10_000, 20_000])
    poses = np.array([[0.0, 0.0, 0.0], [0.018, 0.0, 0.0], [0.038, 0.0, 0.0]])
    # 1.5 times 0.6 m/s for 10 ms is 9 mm, and 10 mm for the noise.
    assert jumps(utime, poses, REACH).tolist() == [False, True]
    turned = np.array([[0.0, 0.0, 3.1], [0.0, 0.0, -3.1], [0.0, 0.0, 0.0]])
    assert jumps(utime, turned, REACH).tolist() == [False, True]


def test_frames_that_all_jump_take_no_longer_than_others():
    """Another unit, or noise only: as many pieces as frames."""
    poses = np.random.default_rng(1).uniform(-100.0, 100.0, (5000, 3))
    tracked = tracks(times(5000), poses, REACH)
    assert len(tracked.number) == 5000


@pytest.mark.parametrize(
    ("noise_m", "noise_rad", "expected"),
    [
        (0.0, 0.0, (SLACK_M[0], SLACK_RAD[0])),
        (0.003, 0.02, None),
        (1.0, 1.0, (SLACK_M[1], SLACK_RAD[1])),
    ],
)
def test_noisy_cameras_get_more_slack(noise_m, noise_rad, expected):
    spread = (noise_m, noise_m, noise_rad)
    poses = np.random.default_rng(1).standard_normal((2000, 3)) * spread
    reach = reach_of(times(2000), poses, V, OMEGA)
    if expected is None:
        assert SLACK_M[0] < reach.slack_m < SLACK_M[1]
        assert SLACK_RAD[0] < reach.slack_rad < SLACK_RAD[1]
        assert not jumps(times(2000), poses, reach).any()
    else:
        assert (reach.slack_m, reach.slack_rad) == expected


def test_of_fewer_than_two_frames_there_is_no_step():
    assert reach_of(times(1), np.zeros((1, 3)), V, OMEGA).slack_m == SLACK_M[0]
    assert tracks(times(1), np.zeros((1, 3)), REACH).number.tolist() == [0]

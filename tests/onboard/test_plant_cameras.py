import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from koopman_lab.config.load import load_config
from koopman_lab.geometry.planar import Pose, compose
from onboard.plant.cameras.cameras import Cameras

PERIOD_US = 4167
TRUE = Pose(1.0, -2.0, math.pi)


def film(*overrides, preset="lab", frames=4000, pose=TRUE):
    """Expose a standing robot; return ``(handed out at, utime, pose, valid)`` of each frame."""
    config = load_config(
        preset=preset, overrides=[f"simulation.cameras.{text}" for text in overrides]
    )
    cameras = Cameras(config.simulation.cameras, np.random.default_rng(0))
    rows = []
    for k in range(frames):
        cameras.expose(k * PERIOD_US, pose)
        for now_us in range(k * PERIOD_US, (k + 1) * PERIOD_US, 100):
            rows += [(now_us, *frame) for frame in cameras.ready(now_us)]
    return rows


poses = st.builds(Pose, st.floats(-5, 5), st.floats(-5, 5), st.floats(-3.1, 3.1))


@given(poses)
def test_ideal_cameras_see_the_pose_at_once(pose):
    rows = film(preset="ideal", frames=3, pose=pose)
    assert [now for now, *_ in rows] == [0, PERIOD_US, 2 * PERIOD_US]
    for _, _, seen, valid in rows:
        assert valid
        assert seen == pytest.approx(pose, abs=1e-12)


def test_noise_around_the_marker_frame():
    rows = film("lost_frame_share=0.1")
    good = np.array([seen for _, _, seen, valid in rows if valid])
    assert 0.08 < 1 - len(good) / len(rows) < 0.12
    marker = compose(TRUE, Pose(0.002, 0.001, 0.0087))
    assert good[:, :2].mean(axis=0) == pytest.approx((marker.x1, marker.x2), abs=3e-5)
    assert good[:, :2].std(axis=0) == pytest.approx((0.0002, 0.0002), rel=0.1)
    turned = np.angle(np.exp(1j * (good[:, 2] - marker.theta)))
    assert turned.mean() == pytest.approx(0.0, abs=1e-4)
    assert turned.std() == pytest.approx(0.00087, rel=0.1)
    assert np.all(good[:, 2] > -math.pi)
    assert np.all(good[:, 2] <= math.pi)


def test_latency_jitters_and_frames_keep_their_order():
    rows = film("latency_s=0.01", "latency_jitter_s=0.006")
    delays = np.array([now - utime for now, utime, _, _ in rows])
    assert delays.min() >= 10_000
    assert delays.max() <= 16_100
    assert delays.min() < 10_300
    assert delays.max() > 15_700
    utimes = [utime for _, utime, _, _ in rows]
    assert utimes == list(range(0, PERIOD_US * len(rows), PERIOD_US))


def test_occlusions_hide_the_robot_for_a_while():
    rows = film(
        "occlusions_per_s=0.5", "occlusion_s=[0.1, 0.2]", "lost_frame_share=0.0", frames=20_000
    )
    valid = np.array([valid for *_, valid in rows])
    starts, ends = (np.flatnonzero(np.diff(valid.astype(int)) == step) for step in (-1, 1))
    count = min(len(starts), len(ends))
    # 20 000 frames last 83 s; a gap of 2 s on average and 0.15 s of occlusion make 39 of them.
    assert 25 < count < 55
    lengths = (ends[:count] - starts[:count]) * PERIOD_US * 1e-6
    assert np.all(lengths > 0.095)
    assert np.all(lengths < 0.205)


def test_the_same_seed_sees_the_same():
    assert film(preset="harsh", frames=500) == film(preset="harsh", frames=500)

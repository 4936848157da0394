"""How a channel flows: against plain sums over what arrived."""

import numpy as np
import pytest

import lcmtypes
from koopman_lab.bus.channels import MOCAP_POSE
from koopman_lab.config.load import load_config
from offboard.viewer.streams import MOST_ARRIVALS, WINDOW_S, Stream

CONFIG = load_config()


def heard(arrivals_us):
    """Return a stream of poses that arrived then."""
    stream, pose = Stream(MOCAP_POSE.name("R1"), MOCAP_POSE), lcmtypes.mocap_pose_t()
    for pose.sequence, arrived_us in enumerate(arrivals_us):
        stream.take(pose.encode(), arrived_us)
    return stream


@pytest.mark.parametrize("count", [2, 3, MOST_ARRIVALS - 1, MOST_ARRIVALS, MOST_ARRIVALS + 7, 5000])
def test_rate_and_jitter_are_those_of_the_newest_arrivals(count):
    rng = np.random.default_rng(count)
    arrivals_us = np.cumsum(rng.integers(0, 10_000, count))
    now_us = int(arrivals_us[-1])
    flow = heard(arrivals_us.tolist()).flow(now_us, CONFIG)
    steps = np.diff(arrivals_us[-MOST_ARRIVALS:][arrivals_us[-MOST_ARRIVALS:] >= now_us - 5e6])
    assert flow.messages == count
    assert flow.rate_hz == pytest.approx(1e6 / steps.mean())
    assert flow.jitter_s == (pytest.approx(1e-6 * steps.std()) if len(steps) > 1 else None)
    assert flow.lost == 0


def test_an_even_stream_has_its_rate_and_no_jitter():
    flow = heard(range(0, 4_000_000, 10_000)).flow(4_000_000, CONFIG)
    assert flow.rate_hz == pytest.approx(100.0)
    assert flow.jitter_s == 0.0
    assert flow.age_s == pytest.approx(0.01)


def test_what_arrived_before_the_window_has_no_rate():
    flow = heard([0, 10_000, 20_000]).flow(round((WINDOW_S + 1.0) * 1e6), CONFIG)
    assert (flow.rate_hz, flow.jitter_s) == (None, None)
    assert flow.messages == 3

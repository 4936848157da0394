"""How a channel flows: against plain sums over what arrived."""

import numpy as np
import pytest

import lcmtypes
from koopman_lab.bus.channels import MOCAP_POSE
from koopman_lab.config.load import load_config
from offboard.commands.topics import _table
from offboard.monitor.streams import (
    MOST_ARRIVALS,
    WINDOW_S,
    Stream,
    Streams,
    refusal_line,
)

CONFIG = load_config()


def heard(arrivals_us):
    """Return a stream of poses that arrived then."""
    stream, pose = Stream(MOCAP_POSE.name("R1"), MOCAP_POSE), lcmtypes.mocap_pose_t()
    for pose.sequence, arrived_us in enumerate(arrivals_us):
        stream.take(pose.encode(), arrived_us)
    return stream


@pytest.mark.parametrize(
    "count", [40, 41, MOST_ARRIVALS - 1, MOST_ARRIVALS, MOST_ARRIVALS + 7, 5000]
)
def test_rate_and_jitter_are_those_of_the_newest_arrivals(count):
    rng = np.random.default_rng(count)
    arrivals_us = np.cumsum(rng.integers(0, 10_000, count))
    now_us = int(arrivals_us[-1])
    flow = heard(arrivals_us.tolist()).flow(now_us, CONFIG)
    steps = np.diff(arrivals_us[-MOST_ARRIVALS:][arrivals_us[-MOST_ARRIVALS:] >= now_us - 5e6])
    assert flow.messages == count
    # Without those that came close behind each other at first, as from a batch.
    first = np.flatnonzero(steps >= steps.mean() / 2)[0]
    assert flow.rate_hz == pytest.approx(1e6 / steps[first:].mean())
    assert flow.jitter_s == pytest.approx(1e-6 * steps.std())
    assert flow.lost == 0


def test_an_even_stream_has_its_rate_and_no_jitter():
    flow = heard(range(0, 4_000_000, 10_000)).flow(4_000_000, CONFIG)
    assert flow.rate_hz == pytest.approx(100.0)
    assert flow.jitter_s == 0.0
    assert flow.age_s == pytest.approx(0.01)


@pytest.mark.parametrize("rate_hz", [1.0, 2.0, 10.0, 20.0, 100.0, 240.0, 1000.0])
@pytest.mark.parametrize("look_s", [0.002, 0.05, 0.0507, 0.13])
def test_an_even_stream_keeps_its_rate_where_it_is_looked_at_now_and_then(rate_hz, look_s):
    due_s = np.arange(0.0, 8.0, 1.0 / rate_hz) + 0.3 / rate_hz
    look = np.ceil(due_s / look_s)
    within = np.concatenate([np.arange(n) for n in np.unique(look, return_counts=True)[1]])
    arrivals_us = np.round(1e6 * look * look_s + 20 * within).astype(int)
    whole = np.flatnonzero(np.diff(look)) + 1  # who looks takes all that is there
    for end in whole[-4:]:
        heard_us = arrivals_us[max(0, end - MOST_ARRIVALS) : end]
        heard_us = heard_us[heard_us >= heard_us[-1] - 5e6]
        flow = heard(arrivals_us[:end].tolist()).flow(int(heard_us[-1]), CONFIG)
        # At each look all is known to one message; the first batch is not of the span.
        span_s = 1e-6 * (heard_us[-1] - heard_us[0]) - look_s
        assert abs(flow.rate_hz - rate_hz) <= 1.0 / span_s


def test_a_burst_after_silence_has_no_absurd_rate():
    burst_us = list(range(20_000_000, 20_002_400, 6))
    assert heard([0, 10_000, *burst_us]).flow(20_003_000, CONFIG).rate_hz is None
    goes_on_us = list(range(20_110_000, 22_000_000, 100_000))
    assert heard([*burst_us, *goes_on_us]).flow(22_000_000, CONFIG).rate_hz == pytest.approx(
        10.0, 0.02
    )


def test_what_arrived_before_the_window_has_no_rate():
    flow = heard([0, 10_000, 20_000]).flow(round((WINDOW_S + 1.0) * 1e6), CONFIG)
    assert (flow.rate_hz, flow.jitter_s) == (None, None)
    assert flow.messages == 3


def test_bytes_of_another_type_are_counted_apart_and_shown_in_a_column_of_their_own():
    stream = Stream(MOCAP_POSE.name("R1"), MOCAP_POSE)
    for data in (b"", bytes(60), lcmtypes.estop_t().encode()):
        stream.take(data, 1_000_000)
    flow = stream.flow(2_000_000, CONFIG)
    assert (flow.messages, flow.rate_hz, flow.lost, flow.age_s) == (0, None, 0, None)
    assert flow.undecodable == 3
    table = _table([flow, heard([0]).flow(2_000_000, CONFIG)])
    assert table.columns[-1].header == "undecodable"
    assert list(table.columns[-1].cells) == ["3", "0"]
    assert list(table.columns[-2].cells) == ["-", "2.0"]


def test_what_lacks_the_key_is_counted_and_counts_for_nothing_else():
    streams, pose = Streams(), lcmtypes.mocap_pose_t()
    for k in range(5):
        pose.sequence = k
        streams.take("R1_MOCAP_POSE", pose.encode(), k * 10_000)
        streams.refuse("R1_MOTOR_CMD", b"anything", k * 10_000)
        streams.refuse("R1_MOCAP_POSE", b"", k * 10_000)
    flows = {flow.name: flow for flow in streams.flows(50_000, CONFIG)}
    assert (flows["R1_MOCAP_POSE"].messages, flows["R1_MOCAP_POSE"].refused) == (5, 5)
    motor = flows["R1_MOTOR_CMD"]
    assert (motor.messages, motor.refused, motor.rate_hz, motor.age_s) == (0, 5, None, None)
    assert streams.refused_since(40_000) == {"R1_MOCAP_POSE": 5, "R1_MOTOR_CMD": 5}
    assert streams.refused_since(40_001) == {}
    line = refusal_line(streams.refused_since(0))
    assert "without the lab's key" in line
    assert "R1_MOTOR_CMD (5)" in line
    assert refusal_line({}) == ""
    assert refusal_line({f"R{k}_GOAL": 1 for k in range(9)}).endswith("and 5 more")

"""What is wrong with the cameras' stream is said in a second, and what is only bad is not."""

from types import SimpleNamespace

import numpy as np
import pytest

from offboard.desk.camera_stream import CameraStream


def play(frames, seconds=3.0, stream=None):
    """Hand over frames ``(utime, sequence)`` in steps of 50 ms; return what is said at the end."""
    stream = stream or CameraStream("R1_MOCAP_POSE", 240.0)
    steps = [[] for _ in range(round(seconds / 0.05))]
    for utime, sequence in frames:
        if utime < seconds * 1e6:
            steps[int(utime // 50_000)].append(SimpleNamespace(utime=utime, sequence=sequence))
    for step in steps:
        stream.take(step)
    return stream.complaint()


def regular(rate_hz, seconds=3.0, first=7):
    return [(round(k * 1e6 / rate_hz), first + k) for k in range(round(seconds * rate_hz))]


@pytest.mark.parametrize(
    ("frames", "says"),
    [
        ([], "no camera frames"),
        (regular(120.0), "120 frames a second, mocap.rate_hz says 240"),
        (regular(204.0), "204 frames a second"),
        (regular(480.0), "480 frames a second"),
        ([(t, 0) for t, _ in regular(240.0)], "sequence counts 0 in"),
        (
            [f for t, k in regular(240.0) for f in ((t, 2 * k), (t, 2 * k + 1))],
            "must count each frame once",
        ),
        ([(t, 2 * k) for t, k in regular(240.0)], "must count each frame once"),
    ],
)
def test_each_fault_of_a_stream_is_said_from_the_first_second_on(frames, says):
    assert says in play(frames)
    if frames:
        assert says in play(frames, seconds=1.1)


@pytest.mark.parametrize("rate_hz", [232.0, 240.0, 248.0])
@pytest.mark.parametrize("lost", [0.0, 0.02])
def test_a_stream_that_is_merely_bad_is_taken(rate_hz, lost):
    rng = np.random.default_rng(1)
    frames = [f for f in regular(rate_hz, 6.0) if rng.random() >= lost]
    held_up = [f for f in frames if not 2.0e6 <= f[0] < 2.3e6]
    assert play(frames, 6.0) is None
    if rate_hz == 240.0:
        assert play(held_up, 6.0) is None


def test_before_a_second_it_is_being_measured_also_after_a_clock_was_set():
    stream = CameraStream("R1_MOCAP_POSE", 240.0)
    assert "being measured" in play(regular(240.0, 0.5), 0.5, stream)
    assert play(regular(240.0), 3.0, CameraStream("R1_MOCAP_POSE", 240.0)) is None
    later = [(t + 50_000_000, k) for t, k in regular(240.0, 0.5)]
    stream.take([SimpleNamespace(utime=t, sequence=k) for t, k in later])
    assert "being measured" in stream.complaint()

"""How the frames came, by their stamps and numbers alone."""

import numpy as np
import pytest

import lcmtypes
from koopman_lab.data.message_arrays import native_dtype
from koopman_lab.data.received_frames import received_frames

RATE_HZ = 240.0


def frames(utime_us, numbers=None, valid=None):
    messages = np.zeros(len(utime_us), native_dtype(lcmtypes.mocap_pose_t))
    messages["utime"] = utime_us
    messages["sequence"] = np.arange(len(utime_us)) if numbers is None else numbers
    messages["tracking_valid"] = True if valid is None else valid
    return messages


def stamps(count, rate_hz=RATE_HZ, begin_us=10**15):
    return begin_us + np.rint(np.arange(count) * 1e6 / rate_hz).astype(np.int64)


def test_frames_as_they_should_be():
    counted = received_frames(frames(stamps(2400)), RATE_HZ)
    assert counted.rate_hz == pytest.approx(240.0)
    assert (counted.frames, counted.lost, counted.invalid) == (2400, 0, 0)
    assert (counted.publishers, counted.numbering) == (1, "counts")


def test_lost_frames_are_taken_all_the_same():
    kept = np.setdiff1d(np.arange(2400), range(100, 2300, 10))
    counted = received_frames(frames(stamps(2400)[kept], kept), RATE_HZ)
    assert counted.rate_hz == pytest.approx(240.0)
    assert counted.lost == 220


def test_frames_that_were_never_taken_are_a_lower_rate():
    """A machine that is overloaded: 204 Hz instead of 240, and no number is missing."""
    kept = np.setdiff1d(np.arange(24_000), range(0, 24_000, 20))
    kept = kept[kept % 10 != 7]
    counted = received_frames(frames(stamps(24_000)[kept]), RATE_HZ)
    assert counted.rate_hz == pytest.approx(204.0, abs=0.1)
    assert counted.lost == 0


def test_pauses_count_for_nothing():
    """A session that was resumed, hours later or decades before."""
    for pause_us in (10**10, -(10**15)):
        utime = np.concatenate([stamps(1200), stamps(1200, begin_us=10**15 + pause_us)])
        counted = received_frames(frames(utime), RATE_HZ)
        assert counted.rate_hz == pytest.approx(240.0)
        assert (counted.publishers, counted.numbering) == (1, "counts")


def interleaved(first_number, shift_us):
    """Two bridges at once."""
    one, two = stamps(1200), stamps(1200) + shift_us
    numbers = np.concatenate([np.arange(1200), first_number + np.arange(1200)])
    return frames(np.concatenate([one, two]), numbers)


@pytest.mark.parametrize(
    ("messages", "publishers", "numbering"),
    [
        (frames(stamps(2400), np.zeros(2400, int)), 1, "stands still"),
        (frames(np.repeat(stamps(1200), 2)), 1, "repeats"),
        (interleaved(0, 2000), 2, "counts"),
        (interleaved(5000, 2000), 2, "counts"),
        (frames(stamps(2400), np.random.default_rng(0).integers(0, 99, 2400)), 1, "starts again"),
        (frames(stamps(2400), np.r_[0:1200, 0:1200]), 1, "counts"),
    ],
    ids=["never set", "doubled", "two alike", "two", "random", "a restart"],
)
def test_who_speaks_and_how_it_counts(messages, publishers, numbering):
    counted = received_frames(messages, RATE_HZ)
    assert (counted.publishers, counted.numbering) == (publishers, numbering)


@pytest.mark.parametrize("count", [0, 1])
def test_too_few_frames_have_no_rate(count):
    counted = received_frames(frames(stamps(count)), RATE_HZ)
    assert counted.rate_hz is None
    assert counted.frames == count


def test_invalid_frames_are_counted():
    valid = np.arange(240) % 4 > 0
    assert received_frames(frames(stamps(240), valid=valid), RATE_HZ).invalid == 60

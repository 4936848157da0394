"""Motion of any two times is that of the curve between them."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from offboard.desk.motion_track import LONGEST_STEP_US, MEMORY_US, Motion, MotionTrack

STEPS = st.lists(
    st.tuples(st.integers(1_000, 60_000), *[st.floats(-0.1, 0.1)] * 3), min_size=2, max_size=20
)


@given(STEPS, st.floats(0, 1), st.floats(0, 1))
def test_between_two_times_lies_what_was_added_there(steps, first, second):
    track, at_us, ends = MotionTrack(), 1_000_000, [1_000_000]
    track.add(at_us, 9.0, 9.0, 9.0)
    for duration_us, *motion in steps:
        at_us += duration_us
        ends.append(at_us)
        track.add(at_us, *motion)
    span_us = at_us - 1_000_000
    low, high = (1_000_000 + round(share * span_us) for share in sorted((first, second)))
    expected = [0.0] * 5
    for (duration_us, forward, sideways, turned), end_us in zip(steps, ends[1:], strict=True):
        begin_us = end_us - duration_us
        share = max(0, min(high, end_us) - max(low, begin_us)) / duration_us
        for k, value in enumerate((forward, sideways, turned, abs(forward), abs(turned))):
            expected[k] += share * value
    assert track.between(low, high) == pytest.approx(Motion(*expected), abs=1e-9)


@pytest.mark.parametrize(
    ("step_us", "kept"), [(LONGEST_STEP_US, True), (LONGEST_STEP_US + 1, False), (-1, False)]
)
def test_time_that_leaps_or_goes_back_begins_anew(step_us, kept):
    track = MotionTrack()
    track.add(1_000_000, 0.0, 0.0, 0.0)
    track.add(1_050_000, 1.0, 0.0, 0.0)
    track.add(1_050_000 + step_us, 1.0, 0.0, 0.0)
    begins_us = 1_000_000 if kept else 1_050_000 + step_us
    assert track.span_us == (begins_us, 1_050_000 + step_us)


def test_the_same_time_again_changes_nothing_and_what_is_old_is_forgotten():
    track = MotionTrack()
    assert track.span_us is None
    for k in range(100):
        for _ in range(2):
            track.add(k * 50_000, 1.0, 0.0, 0.0)
    first_us, last_us = track.span_us
    assert last_us == 99 * 50_000
    assert last_us - first_us == MEMORY_US
    assert track.between(last_us - 500_000, last_us).forward_m == pytest.approx(10.0)

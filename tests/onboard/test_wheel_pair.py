"""Both wheels against both duties: closed forms, symmetries, and unlike motors that obey."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from onboard.motor_loop.running_on import (
    MOST_EFFORT_S,
    MOST_TIME_S,
    MOST_TURN_RAD,
    NOISE_RAD_PER_S,
    RUN_OUT_S,
)
from onboard.motor_loop.wheel_pair import (
    LEFT,
    MOST_FRICTION_DUTY,
    MOST_UNLIKE,
    RIGHT,
    WheelPairPlausibility,
)

TICK_S = 0.01
ONE_COUNT = 2.0 * math.pi / 2400 / TICK_S
NOISE = 2.0 * NOISE_RAD_PER_S
TOLD = (3.0, 5.0)


def ticks_until(duties, speeds, setpoints=(0.0, 0.0), most=200):
    """Return after how many ticks of the same a wheel is found, and which; None if none is."""
    pair = WheelPairPlausibility(ONE_COUNT)
    for k in range(most):
        wheel = pair.judge(duties, setpoints, speeds, TICK_S)
        if wheel is not None:
            return k + 1, wheel
    return None


def closed_form(lead, push):
    """Return after how many ticks a difference is found that should fall and does not."""
    left = 1.0 - TICK_S / RUN_OUT_S
    allowed = 1 + math.floor(math.log(1.0 - NOISE / lead) / math.log(left))
    a_tick = TICK_S * (1 / MOST_TIME_S + push / MOST_EFFORT_S + lead / MOST_TURN_RAD)
    return allowed + math.ceil(1.0 / a_tick)


@pytest.mark.parametrize("lead", [2.0, 5.0, 12.0])
@pytest.mark.parametrize("push", [0.25, 0.4, 0.6])
def test_a_faster_wheel_with_less_duty_is_found_when_the_closed_form_says(lead, push):
    """Here left and right drive each other; where they are reversed as well their sum is wrong."""
    duties = 0.3 - push / 2, 0.3 + push / 2
    ticks, wheel = ticks_until(duties, (8.0 + lead / 2, 8.0 - lead / 2))
    assert (ticks, wheel) == (closed_form(lead, push), LEFT)
    ticks, wheel = ticks_until((duties[0], -duties[1]), (8.0 + lead / 2, -8.0 + lead / 2))
    assert (ticks, wheel) == (closed_form(lead, push), LEFT)


@pytest.mark.parametrize("mean", [0.1, 0.4, 0.8])
def test_unlike_motors_need_unlike_duties(mean):
    explained = MOST_UNLIKE * mean + MOST_FRICTION_DUTY
    for share, found in ((0.99, False), (1.01, True)):
        half = share * explained / 2
        assert (ticks_until((mean - half, mean + half), (10.0, 6.0)) is not None) is found


def test_the_one_that_is_farther_off_its_set_point_is_named():
    assert ticks_until((0.8, 0.2), (3.0, 12.0), setpoints=(12.0, 12.0))[1] is LEFT
    assert ticks_until((0.8, 0.2), (3.0, 12.0), setpoints=(3.0, 3.0))[1] is RIGHT


def test_a_wheel_that_hardly_turns_is_stuck_not_exchanged():
    assert ticks_until((0.2, 0.8), (9.0, 0.9 * NOISE_RAD_PER_S)) is None
    assert ticks_until((0.2, 0.8), (9.0, 1.1 * NOISE_RAD_PER_S)) is not None


SIGNALS = st.lists(
    st.tuples(
        st.floats(-1.0, 1.0), st.floats(-1.0, 1.0), st.floats(-60.0, 60.0), st.floats(-60.0, 60.0)
    ),
    max_size=40,
)


@given(SIGNALS)
def test_forward_and_backward_left_and_right_are_alike(signals):
    pairs = [WheelPairPlausibility(ONE_COUNT) for _ in range(3)]
    for left_duty, right_duty, left, right in signals:
        found = pairs[0].judge((left_duty, right_duty), TOLD, (left, right), TICK_S)
        backward = (-TOLD[0], -TOLD[1]), (-left, -right)
        assert pairs[1].judge((-left_duty, -right_duty), *backward, TICK_S) == found
        mirrored = pairs[2].judge((right_duty, left_duty), TOLD[::-1], (right, left), TICK_S)
        if abs(left - TOLD[0]) != abs(right - TOLD[1]):
            assert mirrored == {LEFT: RIGHT, RIGHT: LEFT, None: None}[found]


@given(SIGNALS)
def test_no_wheel_without_duty_and_none_without_time_is_accused(signals):
    still, timeless = WheelPairPlausibility(ONE_COUNT), WheelPairPlausibility(ONE_COUNT)
    for left_duty, right_duty, left, right in signals:
        assert still.judge((0.0, 0.0), TOLD, (left, right), TICK_S) is None
        assert timeless.judge((left_duty, right_duty), TOLD, (left, right), 0.0) is None


@given(
    st.floats(1.0, 1.4),
    st.floats(0.02, 0.3),
    st.floats(10.0, 120.0),
    st.tuples(st.floats(-12.0, 12.0), st.floats(-12.0, 12.0)),
    st.lists(st.tuples(st.floats(-1.0, 1.0), st.floats(-1.0, 1.0), st.integers(1, 30)), max_size=8),
)
def test_unlike_motors_that_obey_are_not_accused_whatever_their_duties(
    stronger, lag_s, full, speeds, pushes
):
    """First-order lags, as a step response has it; the mean over a tick is in closed form."""
    pair = WheelPairPlausibility(ONE_COUNT)
    fulls = full * stronger / (0.5 + 0.5 * stronger), full / (0.5 + 0.5 * stronger)
    left = math.exp(-TICK_S / lag_s)
    for *duties, ticks in pushes:
        for _ in range(ticks):
            steady = [most * duty for most, duty in zip(fulls, duties, strict=True)]
            mean = [
                end + (speed - end) * lag_s / TICK_S * (1.0 - left)
                for end, speed in zip(steady, speeds, strict=True)
            ]
            speeds = [end + (speed - end) * left for end, speed in zip(steady, speeds, strict=True)]
            assert pair.judge(duties, (0.0, 0.0), mean, TICK_S) is None

"""The speed controller of a wheel by itself, term by term, against closed forms."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from koopman_lab.config.load import load_config
from onboard.motor_loop.pid import WheelController

TICK_S = 0.01
SETTINGS = load_config().motor_loop.pid
NOTHING = {
    "proportional": 0.0, "integral_per_s": 0.0, "derivative_s": 0.0, "feed_forward_lag_s": 0.0,
    "friction_duty": 0.0, "feed_forward_full_duty_rad_per_s": math.inf,
}  # fmt: skip
"""A controller that does nothing but what a test adds."""
speeds = st.lists(st.floats(-5.0, 5.0), min_size=2, max_size=30)


def wheel(**terms):
    return WheelController(SETTINGS.model_copy(update=NOTHING | terms))


def duties(controller, setpoints, measured):
    return [controller.step(s, m, TICK_S) for s, m in zip(setpoints, measured, strict=True)]


@given(speeds)
def test_feed_forward_inverts_the_motor(setpoints):
    """A first-order lag with Coulomb friction; the first set-point is no step."""
    controller = wheel(
        feed_forward_full_duty_rad_per_s=40.0, feed_forward_lag_s=0.05, friction_duty=0.03
    )
    before = [setpoints[0], *setpoints]
    expected = [
        (s + 0.05 * (s - b) / TICK_S) / 40.0 + (math.copysign(0.03, s) if s else 0.0)
        for s, b in zip(setpoints, before, strict=False)
    ]
    done = duties(controller, setpoints, [0.0] * len(setpoints))
    assert done == pytest.approx([max(-1.0, min(1.0, d)) for d in expected], abs=1e-9)


@given(speeds, st.data())
def test_the_proportional_term_answers_the_error_of_the_tick_that_was_measured(setpoints, data):
    n = len(setpoints)
    measured = data.draw(st.lists(st.floats(-5.0, 5.0), min_size=n, max_size=n))
    before = [setpoints[0], *setpoints]
    done = duties(wheel(proportional=0.02), setpoints, measured)
    expected = [0.02 * (b - m) for b, m in zip(before, measured, strict=False)]
    assert done == pytest.approx(expected, abs=1e-9)


@given(st.floats(-2.0, 2.0), st.integers(1, 40))
def test_the_integral_term_is_the_sum_of_the_errors_before(error, ticks):
    done = duties(wheel(integral_per_s=0.5), [error] * ticks, [0.0] * ticks)
    assert done == pytest.approx([0.5 * error * TICK_S * k for k in range(ticks)], abs=1e-9)


@given(st.floats(-5.0, 5.0), st.floats(-50.0, 50.0))
def test_the_derivative_term_works_against_the_filtered_change_of_the_speed(start, slope):
    """The filter is of first order: after a ramp has begun it knows 1 - (1 - a)^k of the slope."""
    filter_s, gain_s, ticks = 0.02, 0.004, 40
    controller = wheel(derivative_s=gain_s, derivative_filter_s=filter_s)
    measured = [start + slope * TICK_S * k for k in range(ticks)]
    done = duties(controller, [0.0] * ticks, measured)
    a = TICK_S / (filter_s + TICK_S)
    known = [slope * (1.0 - (1.0 - a) ** k) for k in range(ticks)]
    assert done == pytest.approx([-gain_s * s for s in known], abs=1e-9)


def test_a_step_of_the_set_point_does_not_kick_the_derivative_term():
    done = duties(wheel(derivative_s=0.1), [0.0, 0.0, 9.0, 9.0, -9.0], [1.0] * 5)
    assert done == [0.0] * 5


@given(st.floats(-1e6, 1e6), st.floats(-1e6, 1e6))
def test_a_duty_is_never_larger_than_full(setpoint, measured):
    controller = WheelController(SETTINGS)
    for duty in duties(controller, [setpoint] * 5, [measured] * 5):
        assert -1.0 <= duty <= 1.0


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("ticks", [10, 1000])
def test_the_integral_stands_still_while_the_duty_is_limited_on_its_side(sign, ticks):
    """However long a wheel was held at full duty, it does not run on afterwards."""
    controller = wheel(proportional=0.5, integral_per_s=0.5)
    duties(controller, [sign * 0.5] * 20, [0.0] * 20)
    learned = 0.5 * sign * 0.5 * TICK_S * 20
    assert duties(controller, [sign * 10.0] * 2, [0.0] * 2)[-1] == sign
    # The first of both ticks was still held against the set-point before.
    learned += 0.5 * sign * 0.5 * TICK_S
    assert duties(controller, [sign * 10.0] * ticks, [0.0] * ticks)[-1] == sign
    assert controller.step(sign * 10.0, sign * 10.0, TICK_S) == pytest.approx(learned)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_the_integral_unwinds_while_the_duty_is_limited_on_the_other_side(sign):
    """Feed-forward alone is at the limit; the wheel is too fast, and the integral says so."""
    controller = wheel(integral_per_s=0.5, feed_forward_full_duty_rad_per_s=1.0)
    measured, ticks = sign * 12.0, 30
    assert duties(controller, [sign * 10.0] * ticks, [measured] * ticks)[-1] == sign
    # Without feed-forward only the integral is left: the error was -2 rad/s all the time.
    duty = controller.step(0.0, sign * 10.0, TICK_S)
    assert duty == pytest.approx(-0.5 * sign * 2.0 * TICK_S * ticks)


def test_a_reset_controller_is_a_new_one():
    controller, new = WheelController(SETTINGS), WheelController(SETTINGS)
    duties(controller, [3.0, 5.0, 8.0], [1.0, 2.0, 9.0])
    controller.reset()
    again = [4.0, 6.0], [3.0, 5.0]
    assert duties(controller, *again) == duties(new, *again)

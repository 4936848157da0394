"""One wheel against its duty and its set-point: closed forms, and motors that obey."""

import math

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from onboard.motor_loop.running_on import (
    COUNTS_OF_NOISE,
    MOST_EFFORT_S,
    MOST_TIME_S,
    MOST_TURN_RAD,
    NOISE_RAD_PER_S,
    RUN_OUT_S,
)
from onboard.motor_loop.wheel_plausibility import (
    MOST_BEHIND_S,
    MOST_OF_BELIEVED,
    Contradiction,
    WheelPlausibility,
)

TICK_S = 0.01
FULL, FASTEST = 60.0, 12.0
"""What feed-forward believes, and the largest set-point, about those of preset `real` (rad/s)."""
SLOWEST_LAG_S, FASTEST_MOTOR = 0.3, 120.0


def one_count(counts_per_rev):
    return 2.0 * math.pi / counts_per_rev / TICK_S


def wheel(counts_per_rev=2400):
    return WheelPlausibility(one_count(counts_per_rev), FULL, FASTEST)


def ticks_until(judge, most=200):
    """Return after how many ticks something is found, and what; None if nothing is."""
    for k in range(most):
        contradiction = judge()
        if contradiction is not None:
            return k + 1, contradiction
    return None


@pytest.mark.parametrize("duty", [-0.02, -0.1, -0.5, -1.0])
@pytest.mark.parametrize("speed", [1.0, 3.0, 10.0, 30.0])
def test_a_wheel_that_runs_on_against_its_duty_is_found_when_the_closed_form_says(duty, speed):
    """It is allowed what runs out with RUN_OUT_S, and then time, effort and turn add up."""
    left = 1.0 - TICK_S / RUN_OUT_S
    allowed = 1 + math.floor(math.log(1.0 - NOISE_RAD_PER_S / speed) / math.log(left))
    a_tick = TICK_S * (1 / MOST_TIME_S + abs(duty) / MOST_EFFORT_S + speed / MOST_TURN_RAD)
    judge = wheel()
    ticks, contradiction = ticks_until(lambda: judge.judge(duty, 5.0, speed, TICK_S))
    assert contradiction is Contradiction.CONTRARY
    assert ticks == allowed + math.ceil(1.0 / a_tick)


@given(st.floats(1.0, 100.0), st.floats(0.1, 1.0), st.floats(0.0, 2.0))
def test_one_that_speeds_up_against_its_duty_is_found_in_no_more_than_a_tenth_of_a_second(
    speed, duty, gain
):
    """Beyond what noise hides, any of time, effort and turn alone suffices."""
    speeds = (speed + NOISE_RAD_PER_S * (gain + 1.0) * k for k in range(200))
    judge = wheel()
    ticks, _ = ticks_until(lambda: judge.judge(-duty, 0.0, next(speeds), TICK_S))
    assert (ticks - 2) * TICK_S <= MOST_TIME_S + 1e-9
    assert (ticks - 3) * TICK_S * duty <= MOST_EFFORT_S + 1e-9
    assert (ticks - 3) * TICK_S * speed <= MOST_TURN_RAD + 1e-9


cases = st.lists(
    st.tuples(st.floats(-1.0, 1.0), st.floats(-12.0, 12.0), st.floats(-60.0, 60.0)), max_size=40
)


@given(cases)
def test_forward_and_backward_are_alike(sequence):
    one, other = wheel(), wheel()
    for duty, setpoint, speed in sequence:
        found = one.judge(duty, setpoint, speed, TICK_S)
        assert found is other.judge(-duty, -setpoint, -speed, TICK_S)


@given(st.lists(st.floats(-100.0, 100.0), max_size=60))
def test_a_wheel_without_duty_may_do_as_it_likes(speeds):
    """Somebody pushes the robot, or carries it."""
    judge = wheel()
    assert all(judge.judge(0.0, 0.0, speed, TICK_S) is None for speed in speeds)


@given(st.floats(-5.0, 5.0), st.floats(-1.0, 1.0))
def test_no_time_no_doubt(speed, duty):
    judge = wheel()
    assert ticks_until(lambda: judge.judge(duty, 0.0, speed, 0.0)) is None


class Motor:
    """A first-order lag with Coulomb friction; what is measured are whole counts a tick."""

    def __init__(self, full, lag_s, friction_duty, counts_per_rev, speed):
        self.full, self.lag_s, self.friction = full, lag_s, friction_duty
        self.speed, self.turn = speed, 0.0
        self.count = one_count(counts_per_rev)

    def tick(self, duty):
        sign = math.copysign(1.0, self.speed or duty)
        if self.speed == 0.0 and abs(duty) <= self.friction:
            return 0.0
        steady = self.full * (duty - sign * self.friction)
        left = math.exp(-TICK_S / self.lag_s)
        before = math.floor(self.turn / self.count / TICK_S)
        mean = steady + (self.speed - steady) * self.lag_s / TICK_S * (1.0 - left)
        after = steady + (self.speed - steady) * left
        stops = after * sign <= 0.0
        self.turn += (0.5 * self.speed if stops else mean) * TICK_S
        self.speed = 0.0 if stops else after
        return self.count * (math.floor(self.turn / self.count / TICK_S) - before)


@given(
    st.builds(
        Motor,
        st.floats(10.0, FASTEST_MOTOR),
        st.floats(0.02, SLOWEST_LAG_S),
        st.floats(0.0, 0.1),
        st.sampled_from([800, 2400, 10_000]),
        st.floats(-FASTEST, FASTEST),
    ),
    st.lists(st.tuples(st.floats(-1.0, 1.0), st.integers(1, 30)), min_size=1, max_size=10),
)
@example(Motor(10.0, 0.3, 0.0, 800, 8.0), [(-0.01, 200)])
@example(Motor(120.0, 0.3, 0.0, 2400, 12.0), [(0.0499, 200)])
def test_whatever_its_duty_no_motor_that_obeys_is_contrary(motor, pushes):
    """Braked hard or gently, or run out, and turned round; set-points far off do not matter."""
    judge = wheel(round(2.0 * math.pi / TICK_S / motor.count))
    for duty, ticks in pushes:
        for _ in range(ticks):
            found = judge.judge(duty, 1000.0, motor.tick(duty), TICK_S)
            assert found is not Contradiction.CONTRARY


def test_a_wheel_that_gets_far_too_little_duty_for_its_speed_is_contrary():
    """As where left and right are exchanged; half of that is what a twice as fast motor takes."""
    speed = 10.0
    for share, contrary in ((0.99, True), (1.01, False), (2.0, False)):
        judge = wheel()
        duty = share * speed / (MOST_OF_BELIEVED * FULL)
        found = ticks_until(lambda judge=judge, duty=duty: judge.judge(duty, speed, speed, TICK_S))
        assert (found is not None) is contrary


@pytest.mark.parametrize("setpoint", [0.0, 6.0, -6.0, 12.0])
def test_a_wheel_that_is_driven_on_beyond_every_set_point_is_too_fast(setpoint):
    for beyond, too_fast in ((0.99, False), (1.01, True)):
        judge, speed = wheel(), beyond * (abs(setpoint) + FASTEST)
        found = ticks_until(lambda j=judge, w=speed: j.judge(0.8, setpoint, w, TICK_S))
        assert (found is not None) is too_fast
        assert found is None or found[1] is Contradiction.TOO_FAST


@pytest.mark.parametrize("speed", [0.0, 2.0, 4.9])
def test_a_wheel_that_full_duty_does_not_bring_near_its_set_point_is_too_slow(speed):
    judge = wheel()
    ticks, contradiction = ticks_until(lambda: judge.judge(1.0, 10.0, speed, TICK_S))
    assert contradiction is Contradiction.TOO_SLOW
    assert ticks == 1 + round(MOST_BEHIND_S / TICK_S)


@pytest.mark.parametrize(("duty", "speed"), [(0.999, 2.0), (1.0, 5.1), (-0.999, 2.0)])
def test_one_that_has_room_or_is_near_is_not(duty, speed):
    judge = wheel()
    signed = math.copysign(speed, duty)
    assert ticks_until(lambda: judge.judge(duty, math.copysign(10.0, duty), signed, TICK_S)) is None


@pytest.mark.parametrize("counts", [800, 2400])
def test_the_slowest_motor_is_not_too_slow_on_its_way(counts):
    """It turns at 10 rad/s at full duty, after 0.3 s, and shall come to 8 rad/s."""
    motor, judge = Motor(10.0, SLOWEST_LAG_S, 0.1, counts, 0.0), wheel(counts)
    assert ticks_until(lambda: judge.judge(1.0, 8.0, motor.tick(1.0), TICK_S)) is None


def test_what_was_doubtful_is_forgotten_as_soon_as_the_wheel_obeys():
    judge = wheel()
    for _ in range(100):
        for _ in range(6):
            assert judge.judge(-0.05, 5.0, 10.0, TICK_S) is None
        assert judge.judge(0.05, 5.0, 10.0, TICK_S) is None
    assert ticks_until(lambda: judge.judge(-0.05, 5.0, 10.0, TICK_S)) == (7, Contradiction.CONTRARY)


def test_a_wheel_that_slowed_down_first_is_allowed_no_more_than_one_that_was_slow():
    judge, slow = wheel(), wheel()
    for speed in (10.0, 8.0, 6.0, 4.0):
        assert judge.judge(-0.1, 0.0, speed, TICK_S) is None
    found = ticks_until(lambda: judge.judge(-0.1, 0.0, 3.0, TICK_S))
    assert found == ticks_until(lambda: slow.judge(-0.1, 0.0, 3.0, TICK_S))


def test_a_single_count_is_no_speed():
    for counts_per_rev in (400, 800):
        judge, speed = wheel(counts_per_rev), one_count(counts_per_rev)
        assert COUNTS_OF_NOISE > 1.0
        assert ticks_until(lambda j=judge, w=speed: j.judge(-0.3, 1.0, w, TICK_S)) is None

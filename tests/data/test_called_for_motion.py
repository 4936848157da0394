"""What wheels and inputs call for, against closed forms."""

import cmath
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import lcmtypes
from koopman_lab.data.called_for_motion import InputMotion, WheelMotion
from koopman_lab.data.clock_offset import clock_offset_s
from koopman_lab.data.message_arrays import native_dtype
from koopman_lab.data.segments import Run
from koopman_lab.robots.table import robot_type

PERIOD_US = 50_000
SPEEDS = st.floats(-0.6, 0.6)
RATES = st.floats(-3.0, 3.0)


def wheel_states(utime, v, omega):
    """Return messages of WHEEL_STATE (K,)."""
    messages = np.zeros(len(utime), native_dtype(lcmtypes.wheel_state_t))
    messages["utime"], messages["sequence"] = utime, np.arange(len(utime))
    messages["v_m_per_s"], messages["omega_rad_per_s"] = v, omega
    return messages


def steady(count, v, omega):
    return wheel_states(PERIOD_US * np.arange(count), np.full(count, v), np.full(count, omega))


def us(*values):
    return np.array(values, np.int64)


@given(SPEEDS, RATES, st.integers(0, 900_000), st.integers(1_000, 900_000))
def test_steady_wheels_make_an_arc(v, omega, begin_us, lasts_us):
    wheels = WheelMotion(steady(60, v, omega))
    motion = wheels.between(us(begin_us), us(begin_us + lasts_us))
    time_s = lasts_us / 1e6
    turn = omega * time_s
    arc = v * (cmath.exp(1j * turn) - 1.0) / (1j * omega) if abs(turn) > 1e-6 else v * time_s
    assert motion.turn[0] == pytest.approx(turn, abs=1e-9)
    assert motion.displacement[0] == pytest.approx(arc, abs=1e-6)
    assert wheels.least(begin_us + 100_000, begin_us + 100_000 + lasts_us) == pytest.approx(
        (abs(v) * time_s, abs(omega) * time_s)
    )


def test_where_wheels_are_silent_nothing_is_said():
    times = PERIOD_US * np.array([0, 1, 2, 3, 10, 11, 12])
    wheels = WheelMotion(wheel_states(times, np.full(7, 0.2), np.zeros(7)))
    begins, ends = us(0, 100_000, 500_000, -1, 550_000), us(150_000, 550_000, 600_000, 9, 700_000)
    known = ~np.isnan(wheels.between(begins, ends).turn)
    assert known.tolist() == [True, False, True, False, False]
    assert math.isnan(wheels.least(100_000, 550_000)[0])
    nothing = WheelMotion(wheel_states([], [], []))
    assert np.isnan(nothing.between(us(0), us(1)).turn).all()
    assert math.isnan(nothing.least(0, 1)[0])


@pytest.mark.parametrize("jump_us", [10_000_000, -10_000_000])
def test_what_a_clock_says_that_was_set_is_not_believed(jump_us):
    """A board's clock leaps, and leaps back: nothing of what overlaps in time is taken."""
    times = 20_000_000 + PERIOD_US * np.arange(1000)
    v = np.full(1000, 0.2)
    times[400:420] += jump_us
    v[400:420] = -0.6
    wheels = WheelMotion(wheel_states(times, v, np.zeros(1000)))
    begins = us(*range(20_000_000, 69_000_000, 100_000))
    moved = wheels.between(begins, begins + 100_000).displacement.real
    assert np.nanmin(moved) == pytest.approx(0.02)
    assert np.nanmax(moved) == pytest.approx(0.02)
    assert np.count_nonzero(~np.isnan(moved)) > 250


def test_wheels_that_turned_only_sometimes_did_not_surely_move():
    times = PERIOD_US * np.arange(40)
    v = np.where(times < 1_000_000, 0.0, 0.3)
    wheels = WheelMotion(wheel_states(times, v, np.zeros(40)))
    assert wheels.least(800_000, 1_200_000) == (0.0, 0.0)
    assert wheels.least(1_200_000, 1_400_000)[0] == pytest.approx(0.06)


RUNS = [Run(0, 1, (0.2, -0.4), 1_000_000, 3_000_000), Run(1, 2, (0.2, 0.6), 5_000_000, 6_000_000)]


def test_an_input_of_a_robot_without_drift_says_its_motion():
    robot = robot_type("kinematic")
    inputs = InputMotion(RUNS, robot, settling_s=0.3)
    begins, ends = (
        us(1_300_000, 1_299_999, 2_000_000, 5_400_000),
        us(2_300_000, 2_000_000, 3_000_001, 5_900_000),
    )
    motion = inputs.between(begins, ends)
    assert np.isnan(motion.turn).tolist() == [False, True, True, False]
    x1, x2, theta = robot.step(np.zeros(3), np.array(RUNS[0].u), 1.0)
    assert motion.displacement[0] == pytest.approx(complex(x1, x2))
    assert motion.turn[0] == pytest.approx(theta) == -0.4
    assert motion.turn[3] == pytest.approx(0.3)
    assert inputs.least(5_400_000, 5_900_000) == pytest.approx((abs(motion.displacement[3]), 0.3))


def test_an_input_of_a_robot_that_drifts_says_only_that_it_moved():
    robot = robot_type("dynamic")
    runs = [Run(0, 1, (0.2, 0.0), 0, 2_000_000), Run(1, 0, (0.0, 0.0), 3_000_000, 5_000_000)]
    inputs = InputMotion(runs, robot, settling_s=0.1)
    assert np.isnan(inputs.between(us(500_000), us(1_500_000)).turn).all()
    assert inputs.least(500_000, 1_500_000) == pytest.approx((0.1, 0.0))
    assert inputs.least(3_500_000, 4_500_000) == (0.0, 0.0)
    assert math.isnan(inputs.least(2_100_000, 2_200_000)[0])
    assert inputs.least(1_500_000, 2_500_000) == pytest.approx((0.025, 0.0))


@given(st.floats(-3000.0, 3000.0), st.integers(0, 100))
def test_the_offset_of_two_clocks_comes_back(offset_s, seed):
    rng = np.random.default_rng(seed)
    omega = np.repeat(rng.uniform(-1.5, 1.5, 40), 20)
    wheels = WheelMotion(wheel_states(10**9 + PERIOD_US * np.arange(800), np.zeros(800), omega))
    fine = np.arange(0, 39_900_000, 4167)
    theta = np.interp(fine, PERIOD_US * np.arange(800), np.cumsum(omega) * PERIOD_US / 1e6)
    wrapped = np.remainder(theta + np.pi, 2.0 * np.pi) - np.pi
    stamps = (10**9 + fine + offset_s * 1e6).astype(np.int64)
    offset = clock_offset_s(stamps, wrapped, wheels)
    if abs(offset_s) > 0.3:
        assert offset == pytest.approx(offset_s, abs=0.1)
    elif abs(offset_s) < 0.1:
        assert offset is None


def test_motions_that_are_not_the_same_have_no_offset():
    rng = np.random.default_rng(0)
    wheels = WheelMotion(
        wheel_states(PERIOD_US * np.arange(800), np.zeros(800), rng.uniform(-1.5, 1.5, 800))
    )
    theta = np.cumsum(rng.uniform(-0.05, 0.05, 800))
    utime = PERIOD_US * np.arange(800)
    assert clock_offset_s(utime, theta, wheels) is None
    assert clock_offset_s(utime, np.zeros(800), wheels) is None
    assert clock_offset_s(utime[:1], theta[:1], wheels) is None
    years = np.array([0, 10**16])
    assert clock_offset_s(years, np.zeros(2), wheels) is None

"""Commands, set-points, and who may command."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from motor_bench import CONTROLLER, SAMPLER, TICK_US, Bench

from koopman_lab.config.load import load_config
from koopman_lab.geometry.planar import Velocity
from koopman_lab.robots.body_drive import BY_ACCELERATIONS
from koopman_lab.units import COUNTER_RANGE
from onboard.motor_loop.command_arbiter import NOBODY, Intent
from onboard.motor_loop.loop import State
from onboard.motor_loop.odometry import Odometry
from onboard.motor_loop.setpoint import Setpoint, approach, saturate

CONFIGS = {robot: load_config(robot=robot) for robot in ("kinematic", "dynamic")}


def test_velocity_step_settles_with_little_overshoot(kinematic):
    v = kinematic.drive((0.3, 0.0), 2.0)[:, 2]
    assert np.all(np.abs(v[40:] - v[-50:].mean()) < 0.02 * 0.3)
    assert v.max() < 1.1 * 0.3


def test_acceleration_ramp_is_tracked(dynamic):
    rows = dynamic.drive((0.2, 0.0), 2.0)
    assert rows[-1, 0] == pytest.approx(0.4)
    assert np.sqrt(np.mean((rows[:, 2] - rows[:, 0]) ** 2)) < 0.01


def test_the_setpoint_reaches_the_sum_of_the_commands_whatever_the_jitter():
    limits = load_config(robot="dynamic").motor_loop.limits
    ramp = Setpoint(BY_ACCELERATIONS, limits, 0.05, 0.01)
    setpoint = Velocity(0.0, 0.0)
    for ticks in (4, 6, 5, 7, 3, 5):
        ramp.command((0.2, -0.5))
        for _ in range(ticks):
            setpoint = ramp.step(setpoint)
    assert setpoint == pytest.approx((6 * 0.2 * 0.05, -6 * 0.5 * 0.05), abs=1e-12)
    for _ in range(100):
        setpoint = ramp.step(setpoint)
    assert setpoint == pytest.approx((0.06, -0.15), abs=1e-12)


def test_releasing_brings_the_robot_to_rest_and_frees_it(dynamic):
    dynamic.drive((0.2, 0.5), 1.0)
    assert dynamic.command((0.0, 0.0), intent=Intent.RELEASE) is None
    for _ in range(50):
        dynamic.tick()
    assert dynamic.loop.state is State.REST
    assert dynamic.loop.arbiter.holder == NOBODY
    assert dynamic.plant.body_velocity() == (0.0, 0.0)
    assert dynamic.command((0.1, 0.0), CONTROLLER, sequence=0) is None


def test_the_first_to_begin_holds_the_robot_and_the_other_is_named(kinematic):
    kinematic.drive((0.2, 0.0), 0.3)
    assert kinematic.command((0.1, 0.0), CONTROLLER) == "commander"
    assert kinematic.loop.arbiter.refused_last == CONTROLLER
    assert kinematic.loop.arbiter.holder == SAMPLER


def test_a_robot_that_nobody_holds_is_taken_only_by_beginning(kinematic):
    for intent in (Intent.CONTINUE, Intent.RELEASE):
        assert kinematic.command((0.1, 0.0), intent=intent) == "order"
    assert kinematic.command((0.1, 0.0), NOBODY) == "order"
    assert kinematic.loop.state is State.REST


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"u1": math.nan}, "value"),
        ({"u2": math.inf}, "value"),
        ({"u1": 0.61}, "value"),
        ({"utime": -600_000}, "stale"),
        ({"utime": 10_000_000}, "stale"),
        ({"sequence": 0}, "order"),
        ({"commander": CONTROLLER}, "commander"),
    ],
)
def test_refused_commands_are_counted_by_reason_and_change_nothing(kinematic, changes, reason):
    kinematic.drive((0.2, 0.0), 0.2)
    aim = kinematic.loop._commanded.aim
    assert kinematic.command((0.3, 0.3), **changes) == reason
    assert kinematic.loop.arbiter.counts.refused[reason] == 1
    assert kinematic.loop._commanded.aim == aim


@pytest.mark.parametrize("copies", [2, 3])
@pytest.mark.parametrize("kind", CONFIGS)
def test_a_command_that_comes_more_than_once_counts_once(kind, copies):
    """As over a radio that repeats: an acceleration would be integrated several times."""
    once, often = Bench(CONFIGS[kind]), Bench(CONFIGS[kind])
    for k in range(60):
        number, since = divmod(k, 5)
        u = (0.3 - 0.02 * number, 0.4)
        if since == 0:
            assert once.command(u, sequence=number) is None
            assert often.command(u, sequence=number) is None
            for _ in range(copies - 1):
                assert often.command(u, sequence=number) == "order"
        if since == 2:
            # So do one that comes late, and one that was overtaken on its way.
            for late in {number, max(0, number - 1)}:
                assert often.command(u, sequence=late) == "order"
        once.tick()
        often.tick()
        assert often.loop.setpoint == once.loop.setpoint
    assert once.loop.setpoint.v > 0.0
    assert often.loop.arbiter.counts.accepted == once.loop.arbiter.counts.accepted == 12


def test_a_standing_robot_gets_no_duty(kinematic):
    kinematic.drive((0.2, 0.5), 0.5)
    kinematic.drive((0.0, 0.0), 1.0)
    assert kinematic.loop.tick(kinematic.now_us) == (0.0, 0.0)


commands = st.tuples(st.floats(-1.2, 1.2), st.floats(-1.2, 1.2), st.integers(0, 8))
"""Inputs as shares of their limits, and after how many ticks the next one comes."""


@pytest.mark.parametrize("robot", ["kinematic", "dynamic"])
@settings(max_examples=50)
@given(st.lists(commands, min_size=1, max_size=20))
def test_setpoints_and_accelerations_stay_within_limits(robot, sent):
    config = CONFIGS[robot]
    bench, limits = Bench(config), config.motor_loop.limits
    bench.command((0.0, 0.0))
    largest = np.array([limits.v_m_per_s, limits.omega_rad_per_s])
    fastest = np.array([limits.a_m_per_s2, limits.d_omega_rad_per_s2]) * 0.01
    before = np.zeros(2)
    largest_u = np.array(bench.loop.arbiter._largest_u)
    for *shares, ticks in sent:
        bench.command(largest_u * shares)
        for _ in range(ticks):
            bench.tick()
            setpoint = np.array(bench.loop.setpoint)
            assert np.all(np.abs(setpoint) <= largest * (1 + 1e-9))
            assert np.all(np.abs(setpoint - before) <= fastest * (1 + 1e-9))
            before = setpoint


@given(st.floats(-5, 5), st.floats(-20, 20))
def test_saturation_keeps_the_curvature(v, omega):
    limits = load_config().motor_loop.limits
    limited = saturate(Velocity(v, omega), limits)
    assert limited.v * omega == pytest.approx(limited.omega * v, abs=1e-9)
    assert abs(limited.v) <= limits.v_m_per_s * (1 + 1e-12)
    assert abs(limited.omega) <= limits.omega_rad_per_s * (1 + 1e-12)


@given(st.floats(-0.6, 0.6), st.floats(-3, 3), st.floats(-0.6, 0.6), st.floats(-3, 3))
def test_approach_ends_at_the_target_within_the_accelerations(v0, w0, v1, w1):
    limits = load_config().motor_loop.limits
    now, target = Velocity(v0, w0), Velocity(v1, w1)
    for _ in range(200):
        after = approach(now, target, limits, 0.01)
        assert abs(after.v - now.v) <= limits.a_m_per_s2 * 0.01 * (1 + 1e-9)
        assert abs(after.omega - now.omega) <= limits.d_omega_rad_per_s2 * 0.01 * (1 + 1e-9)
        now = after
    assert now == target


@given(st.integers(-(COUNTER_RANGE // 2), COUNTER_RANGE // 2 - 1), st.integers(-5000, 5000))
def test_counter_wrap_gives_the_same_speed_anywhere(start, change):
    def wrapped(n):
        return (n + COUNTER_RANGE // 2) % COUNTER_RANGE - COUNTER_RANGE // 2

    odometry = Odometry(2400, 0.05)
    for k in range(8):
        odometry.update(k * TICK_US, wrapped(start + k * change), wrapped(start - k * change))
    speed = change / 2400 * 2 * math.pi / 0.01
    utime, window_s, *mean = odometry.mean()
    for speeds in (odometry.newest(), mean):
        assert speeds == pytest.approx((speed, -speed), abs=1e-9)
    assert window_s == pytest.approx(0.05)
    assert utime == 70_000 - 25_000

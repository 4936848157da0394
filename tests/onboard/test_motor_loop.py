import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from koopman_lab.config.load import load_config
from koopman_lab.geometry import Velocity
from onboard.motor_loop.loop import Command, MotorLoop, State
from onboard.motor_loop.odometry import COUNTER_RANGE, Odometry
from onboard.motor_loop.setpoint import AccelerationRamp, approach, saturate
from onboard.plant.plant import Plant

TICK_US = 10_000
SAMPLER, CONTROLLER = 1, 2


class Bench:
    """The loop on the plant, tick by tick, without a bus."""

    def __init__(self, config):
        self.plant = Plant(config, np.random.default_rng(0))
        self.loop = MotorLoop(config)
        self.now_us = 0
        self.sequence = 0

    def tick(self):
        self.plant.advance(self.now_us)
        self.loop.encoder(self.now_us, *self.plant.encoder_counts(), 7.4)
        self.plant.drive(*self.loop.tick(self.now_us))
        self.now_us += TICK_US

    def command(self, u, commander=SAMPLER, **changes):
        fields = {"utime": self.now_us, "sequence": self.sequence, "commander": commander}
        fields |= {"u1": u[0], "u2": u[1]} | changes
        self.sequence += 1
        return self.loop.command(Command(**fields), self.now_us)

    def drive(self, u, seconds):
        """Command every 50 ms; return set-points and true velocities of each tick."""
        rows = []
        for k in range(round(seconds * 100)):
            if k % 5 == 0:
                assert self.command(u) is None
            self.tick()
            rows.append((*self.loop.setpoint, *self.plant.body_velocity()))
        return np.array(rows)


@pytest.fixture
def kinematic():
    return Bench(load_config(robot="kinematic"))


@pytest.fixture
def dynamic():
    return Bench(load_config(robot="dynamic"))


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
    ramp = AccelerationRamp(limits, 0.05, 0.01)
    setpoint = Velocity(0.0, 0.0)
    for ticks in (4, 6, 5, 7, 3, 5):
        ramp.command(0.2, -0.5)
        for _ in range(ticks):
            setpoint = ramp.step(setpoint)
    assert setpoint == pytest.approx((6 * 0.2 * 0.05, -6 * 0.5 * 0.05), abs=1e-12)
    for _ in range(100):
        setpoint = ramp.step(setpoint)
    assert setpoint == pytest.approx((0.06, -0.15), abs=1e-12)


def test_a_silent_commander_ends_in_rest_and_must_begin_again(kinematic):
    kinematic.drive((0.4, 1.0), 1.0)
    states = []
    for _ in range(100):
        kinematic.tick()
        states.append(kinematic.loop.state)
        if states[-1] is State.WATCHDOG and len(states) < 30:
            assert kinematic.command((0.4, 0.0)) == "order"
    assert states.index(State.WATCHDOG) <= 16
    assert states[-1] is State.REST
    assert kinematic.plant.body_velocity() == (0.0, 0.0)
    assert kinematic.command((0.1, 0.0), CONTROLLER, sequence=0) is None


def test_the_estop_acts_in_the_next_tick_and_holds_until_released(dynamic):
    dynamic.drive((0.3, 0.0), 1.0)
    dynamic.loop.estop(True)
    assert dynamic.loop.tick(dynamic.now_us) == (0.0, 0.0)
    assert dynamic.command((0.1, 0.0)) == "order"
    for _ in range(100):
        dynamic.tick()
    assert dynamic.plant.body_velocity() == (0.0, 0.0)
    dynamic.loop.estop(False)
    assert dynamic.command((0.1, 0.0)) is None


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
    target = kinematic.loop._target
    assert kinematic.command((0.3, 0.3), **changes) == reason
    assert kinematic.loop.counts.refused[reason] == 1
    assert kinematic.loop._target == target


def test_a_standing_robot_gets_no_duty(kinematic):
    kinematic.drive((0.2, 0.5), 0.5)
    kinematic.drive((0.0, 0.0), 1.0)
    assert kinematic.loop.tick(kinematic.now_us) == (0.0, 0.0)


commands = st.tuples(st.floats(-3, 3), st.floats(-20, 20))


@settings(max_examples=50)
@given(st.lists(commands, min_size=1, max_size=20))
def test_setpoints_and_accelerations_stay_within_limits(us):
    config = load_config(robot="dynamic")
    bench, limits = Bench(config), config.motor_loop.limits
    before = (0.0, 0.0)
    for u in us:
        assert bench.command(u) is None
        for _ in range(5):
            bench.tick()
            v, omega = bench.loop.setpoint
            assert abs(v) <= limits.v_m_per_s * (1 + 1e-9)
            assert abs(omega) <= limits.omega_rad_per_s * (1 + 1e-9)
            before = (v, omega)
    assert before == bench.loop.setpoint


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
    for speeds in (odometry.newest(), odometry.mean()):
        assert (speeds.left, speeds.right) == pytest.approx((speed, -speed), abs=1e-9)
    assert odometry.mean().window_s == pytest.approx(0.05)
    assert odometry.mean().utime == 70_000 - 25_000

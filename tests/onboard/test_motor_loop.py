import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from koopman_lab.config.load import load_config
from koopman_lab.geometry import REST, Velocity
from koopman_lab.units import COUNTER_RANGE
from onboard.motor_loop.health import Fault
from onboard.motor_loop.hold import NOBODY, Command, Intent
from onboard.motor_loop.loop import MotorLoop, State
from onboard.motor_loop.odometry import Odometry
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
        self.battery_v = 7.4
        self.silent = False

    def tick(self):
        self.plant.advance(self.now_us)
        if not self.silent:
            self.loop.encoder(self.now_us, *self.plant.encoder_counts(), self.battery_v)
        self.plant.drive(*self.loop.tick(self.now_us))
        self.now_us += TICK_US

    def sleep(self, seconds, *, stands):
        """Keep the loop from running; the motors' drivers let go at once, or not at all."""
        if stands:
            self.plant.drive(0.0, 0.0)
        for _ in range(round(seconds * 100)):
            self.plant.advance(self.now_us)
            self.loop.encoder(self.now_us, *self.plant.encoder_counts(), self.battery_v)
            self.now_us += TICK_US

    def command(self, u, commander=SAMPLER, **changes):
        fields = {"utime": self.now_us, "sequence": self.sequence, "commander": commander}
        fields |= {"intent": Intent.BEGIN, "u1": u[0], "u2": u[1]} | changes
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


CONFIGS = {robot: load_config(robot=robot) for robot in ("kinematic", "dynamic")}


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
        if states[-1] is State.WATCHDOG and kinematic.loop.setpoint != REST:
            assert kinematic.command((0.4, 0.0)) == "order"
    assert states.index(State.WATCHDOG) <= 16
    assert states[-1] is State.WATCHDOG
    assert kinematic.plant.body_velocity() == (0.0, 0.0)
    assert kinematic.command((0.1, 0.0), intent=Intent.CONTINUE) == "order"
    assert kinematic.command((0.1, 0.0), CONTROLLER, sequence=0) is None
    assert kinematic.loop.state is State.DRIVING


@pytest.mark.parametrize("stands", [True, False])
def test_a_loop_that_was_kept_from_running_does_not_go_on_where_it_was(kinematic, stands):
    """The robot of 600 ms ago is another one: its wheels stand, or roll down a slope."""
    kinematic.drive((0.3, 0.0), 1.0)
    speed = kinematic.plant.body_velocity()[0]
    loop = kinematic.loop
    kinematic.sleep(0.6, stands=stands)
    duties = loop.tick(kinematic.now_us)
    assert loop.state is State.WATCHDOG
    assert loop.setpoint.v == pytest.approx(0.0 if stands else speed, abs=0.03)
    assert max(map(abs, duties)) < (0.05 if stands else 0.5)
    for _ in range(100):
        kinematic.tick()
        assert not loop.fault
    assert loop.setpoint == REST
    assert kinematic.command((0.1, 0.0), CONTROLLER, sequence=0) is None


def test_releasing_brings_the_robot_to_rest_and_frees_it(dynamic):
    dynamic.drive((0.2, 0.5), 1.0)
    assert dynamic.command((0.0, 0.0), intent=Intent.RELEASE) is None
    for _ in range(50):
        dynamic.tick()
    assert dynamic.loop.state is State.REST
    assert dynamic.loop.hold.holder == NOBODY
    assert dynamic.plant.body_velocity() == (0.0, 0.0)
    assert dynamic.command((0.1, 0.0), CONTROLLER, sequence=0) is None


def test_the_first_to_begin_holds_the_robot_and_the_other_is_named(kinematic):
    kinematic.drive((0.2, 0.0), 0.3)
    assert kinematic.command((0.1, 0.0), CONTROLLER) == "commander"
    assert kinematic.loop.hold.refused_last == CONTROLLER
    assert kinematic.loop.hold.holder == SAMPLER


def test_a_robot_that_nobody_holds_is_taken_only_by_beginning(kinematic):
    for intent in (Intent.CONTINUE, Intent.RELEASE):
        assert kinematic.command((0.1, 0.0), intent=intent) == "order"
    assert kinematic.command((0.1, 0.0), NOBODY) == "order"
    assert kinematic.loop.state is State.REST


def faulty(bench, seconds):
    """Go on commanding; return the ticks until a fault and the fault."""
    for k in range(round(seconds * 100)):
        if k % 5 == 0:
            bench.command((0.3, 0.0), intent=Intent.CONTINUE)
        bench.tick()
        if bench.loop.state is State.FAULT:
            return k + 1, bench.loop.fault
    return None, bench.loop.fault


@pytest.mark.parametrize(
    ("what", "fault", "ticks"),
    [
        ("battery", Fault.BATTERY_LOW, 52),
        ("silent", Fault.ENCODERS_SILENT, 28),
        ("left", Fault.LEFT_WHEEL_STUCK, 24),
        ("right", Fault.RIGHT_WHEEL_STUCK, 24),
    ],
)
def test_a_fault_stops_the_motors_and_holds_until_it_is_released(kinematic, what, fault, ticks):
    kinematic.drive((0.3, 0.0), 1.0)
    left, right = kinematic.plant.encoder_counts()
    if what == "battery":
        kinematic.battery_v = 6.0
    elif what == "silent":
        kinematic.silent = True
    else:
        # The counter of one wheel stands still, the other one's goes on at the same speed.
        step = round(0.3 / 0.03 * 0.01 / (2 * math.pi) * 2400)
        kinematic.plant.encoder_counts = iter_counts(what, left, right, step)
    taken, found = faulty(kinematic, 1.0)
    assert found is fault
    assert taken <= ticks
    assert kinematic.loop.tick(kinematic.now_us) == (0.0, 0.0)
    assert kinematic.command((0.1, 0.0)) == "stopped"
    if what == "silent":
        kinematic.silent = False
        kinematic.tick()
    else:
        kinematic.loop.estop(False)
    assert kinematic.loop.state is State.REST
    assert kinematic.loop.fault is Fault.NO_FAULT
    assert kinematic.command((0.1, 0.0), intent=Intent.CONTINUE) == "order"


def test_a_stuck_encoder_is_found_before_the_wheel_runs_away(kinematic):
    """The speed controller sees no speed and drives ever harder."""
    kinematic.drive((0.3, 0.0), 1.0)
    before, stuck = kinematic.plant.drives.left_rad_per_s, kinematic.plant.encoder_counts()[0]
    counts = kinematic.plant.encoder_counts
    kinematic.plant.encoder_counts = lambda: (stuck, counts()[1])
    fastest = 0.0
    while kinematic.loop.state is not State.FAULT:
        kinematic.command((0.3, 0.0), intent=Intent.CONTINUE)
        kinematic.tick()
        fastest = max(fastest, kinematic.plant.drives.left_rad_per_s)
    assert kinematic.loop.fault is Fault.LEFT_WHEEL_STUCK
    assert fastest < 2.0 * before


def iter_counts(what, left, right, step):
    state = {"left": left, "right": right}

    def counts():
        state["right" if what == "left" else "left"] += step
        return state["left"], state["right"]

    return counts


@pytest.mark.parametrize("v", [-0.006, 0.003, 0.02])
@pytest.mark.parametrize("preset", ["lab", "harsh"])
def test_a_creeping_wheel_that_friction_holds_is_no_stuck_one(preset, v):
    """It breaks away as soon as the speed controller has wound up so far."""
    bench = Bench(load_config(robot="dynamic", preset=preset))
    bench.drive((v / 0.05, 0.0), 0.05)
    way = 0.0
    for row in bench.drive((0.0, 0.0), 8.0):
        way += 0.01 * row[2]
    assert bench.loop.fault is Fault.NO_FAULT
    assert way == pytest.approx(8.0 * v, rel=0.3)


def test_a_short_dip_of_the_battery_is_no_fault(kinematic):
    kinematic.drive((0.2, 0.0), 0.5)
    kinematic.battery_v = 6.0
    assert faulty(kinematic, 0.3)[0] is None
    kinematic.battery_v = 7.2
    assert faulty(kinematic, 1.0)[0] is None


@pytest.mark.parametrize("step_s", [-1000.0, -1.0, 1.0, 1000.0])
def test_a_clock_that_is_set_stops_the_robot_which_then_can_be_taken_again(kinematic, step_s):
    """Ages across the step mean nothing: the robot must not go on by itself."""
    kinematic.drive((0.4, 1.0), 1.0)
    offset_us = round(step_s * 1e6)
    fastest, loop, plant = 0.0, kinematic.loop, kinematic.plant
    for _ in range(60):
        plant.advance(kinematic.now_us)
        now_us = kinematic.now_us + offset_us
        loop.encoder(now_us, *plant.encoder_counts(), 7.4)
        plant.drive(*loop.tick(now_us))
        kinematic.now_us += TICK_US
        fastest = max(fastest, plant.body_velocity()[0])
        assert loop.state is State.WATCHDOG
    assert fastest < 1.1 * 0.4
    assert plant.body_velocity() == (0.0, 0.0)
    kinematic.now_us += offset_us
    assert kinematic.command((0.1, 0.0)) is None
    assert loop.state is State.DRIVING


@pytest.mark.parametrize("step_s", [-1000.0, -1.0])
def test_a_clock_that_is_set_back_does_not_put_a_fault_off(kinematic, step_s):
    kinematic.drive((0.2, 0.0), 0.5)
    kinematic.battery_v = 6.0
    assert faulty(kinematic, 0.3)[0] is None
    offset_us = round(step_s * 1e6)
    for _ in range(60):
        kinematic.plant.advance(kinematic.now_us)
        now_us = kinematic.now_us + offset_us
        kinematic.loop.encoder(now_us, *kinematic.plant.encoder_counts(), 6.0)
        kinematic.plant.drive(*kinematic.loop.tick(now_us))
        kinematic.now_us += TICK_US
    assert kinematic.loop.fault is Fault.BATTERY_LOW


def test_the_estop_acts_in_the_next_tick_and_holds_until_released(dynamic):
    dynamic.drive((0.3, 0.0), 1.0)
    dynamic.loop.estop(True)
    assert dynamic.loop.tick(dynamic.now_us) == (0.0, 0.0)
    assert dynamic.command((0.1, 0.0)) == "stopped"
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
    assert kinematic.loop.hold.counts.refused[reason] == 1
    assert kinematic.loop._target == target


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
    largest_u = np.array(bench.loop.hold._largest_u)
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

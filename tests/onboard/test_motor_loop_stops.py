"""What brings the robot to rest, and what it takes to move it again."""

import math

import pytest
from motor_bench import CONTROLLER, TICK_US, Bench

from koopman_lab.bus.motor_loop_faults import Fault
from koopman_lab.config.load import load_config
from koopman_lab.geometry.planar import REST
from onboard.motor_loop.command_arbiter import Intent
from onboard.motor_loop.health import FOLLOW_US, OLDEST_US
from onboard.motor_loop.loop import State


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


@pytest.mark.parametrize("ahead_us", [-OLDEST_US - 1, -OLDEST_US, OLDEST_US, OLDEST_US + 1])
def test_after_a_pause_counters_that_are_not_of_now_say_nothing(kinematic, ahead_us):
    """Neither those of long ago nor those that seem to be of the future."""
    kinematic.drive((0.3, 0.0), 1.0)
    loop = kinematic.loop
    kinematic.now_us += 600_000
    loop._encoder_us = kinematic.now_us + ahead_us
    loop.tick(kinematic.now_us)
    assert (loop.setpoint != REST) is (abs(ahead_us) <= OLDEST_US)


@pytest.mark.parametrize("step_s", [-1000.0, 0.6, 1000.0])
@pytest.mark.parametrize(("deaf_us", "fault"), [(FOLLOW_US - 10_000, False), (300_000, True)])
def test_after_a_pause_or_a_step_of_the_clock_motors_may_follow_late(
    kinematic, step_s, deaf_us, fault
):
    """Their driver goes on as before until it knows whom to follow; if for good, it is a fault."""
    kinematic.drive((0.4, 0.0), 1.0)
    loop, plant = kinematic.loop, kinematic.plant
    offset_us = round(step_s * 1e6)
    for k in range(100):
        plant.advance(kinematic.now_us)
        loop.encoder(kinematic.now_us + offset_us, *plant.encoder_counts(), 7.4)
        duties = loop.tick(kinematic.now_us + offset_us)
        if k * TICK_US >= deaf_us:
            plant.drive(*duties)
        kinematic.now_us += TICK_US
    assert bool(loop.fault) is fault
    assert plant.body_velocity() == (0.0, 0.0)


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
        kinematic.release()
    assert kinematic.loop.state is State.REST
    assert kinematic.loop.fault is Fault.NO_FAULT
    assert kinematic.command((0.1, 0.0), intent=Intent.CONTINUE) == "order"


def test_counters_that_are_not_heard_accuse_no_wheel(kinematic):
    """What was heard last is no speed of now, while the robot brakes."""
    kinematic.drive((0.6, 0.0), 1.0)
    kinematic.silent = True
    taken = 0
    while not kinematic.loop.fault:
        kinematic.command((-0.6, 0.0), intent=Intent.CONTINUE)
        kinematic.tick()
        taken += 1
    assert kinematic.loop.fault is Fault.ENCODERS_SILENT
    assert taken == 26


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
    dynamic.loop.stop(dynamic.now_us, dynamic.now_us)
    assert dynamic.loop.tick(dynamic.now_us) == (0.0, 0.0)
    assert dynamic.command((0.1, 0.0)) == "stopped"
    for _ in range(100):
        dynamic.tick()
    assert dynamic.plant.body_velocity() == (0.0, 0.0)
    dynamic.release()
    assert dynamic.command((0.1, 0.0)) is None

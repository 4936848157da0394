"""The motor loop as a state machine: every state times every event, and what holds in each."""

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from motor_bench import CONTROLLER, TICK_US, Bench

from koopman_lab.bus.commanders import NOBODY
from koopman_lab.bus.motor_loop_faults import Fault
from koopman_lab.config.load import load_config
from koopman_lab.geometry.planar import REST
from onboard.motor_loop.command_arbiter import Intent
from onboard.motor_loop.loop import LONGEST_HOLD_S, NO_DUTY, State
from onboard.motor_loop.stop_latch import NO_STOP

CONFIGS = {robot: load_config(robot=robot) for robot in ("kinematic", "dynamic")}
FAST = {"kinematic": (0.3, 0.0), "dynamic": (0.5, 0.0)}
"""Inputs that take the robot to 0.3 m/s, at once or in 0.6 s."""
WITHOUT_DUTY = (State.REST, State.ESTOP, State.FAULT)
LONG_AGO_US = 60_000_000


class Robot(Bench):
    """The bench, with everything that can happen to the loop as a method without arguments."""

    def __init__(self, kind):
        super().__init__(CONFIGS[kind])
        self.now_us = 10 * LONG_AGO_US
        self.u = FAST[kind]
        self.duties = NO_DUTY
        self.lie = None
        self.tick()

    def tick(self):
        self.plant.advance(self.now_us)
        if not self.silent:
            counts = self.plant.encoder_counts()
            if self.lie is not None:
                counts = tuple(sign * count for sign, count in zip(self.lie, counts, strict=True))
            self.loop.encoder(self.now_us, *counts, self.battery_v)
        self.duties = self.loop.tick(self.now_us)
        self.plant.drive(*self.duties)
        self.now_us += TICK_US
        self.check()

    def check(self):
        """Look at what holds in each state, whatever has happened."""
        loop = self.loop
        if loop.state in WITHOUT_DUTY:
            assert self.duties == NO_DUTY
            assert loop.setpoint == REST
            assert loop.arbiter.holder == NOBODY
        stopped = loop.state in (State.ESTOP, State.FAULT)
        assert stopped is (loop.stop_latch.number != NO_STOP)
        assert loop.state is not State.FAULT or loop.fault
        assert stopped or not loop.fault
        assert (loop.arbiter.holder != NOBODY) is (loop.state is State.DRIVING)

    def wait(self, ticks):
        for _ in range(ticks):
            self.tick()

    # Events.

    def nothing(self):
        """Let time pass."""

    def begin(self):
        self.command(self.u)

    def go_on(self):
        self.command(self.u, intent=Intent.CONTINUE)

    def give_up(self):
        self.command((0.0, 0.0), intent=Intent.RELEASE)

    def begin_by_another(self):
        self.command(self.u, CONTROLLER)

    def stop(self):
        self.loop.stop(self.now_us, self.now_us)

    def stop_long_ago(self):
        self.loop.stop(self.now_us, self.now_us - LONG_AGO_US)

    def release_of_another_stop(self):
        self.loop.release(self.loop.stop_latch.number + 1, self.now_us)

    def release_long_ago(self):
        self.loop.release(NO_STOP, self.now_us - LONG_AGO_US // 2)

    def release_now(self):
        self.loop.release(NO_STOP, self.now_us)

    def release_by_number_long_ago(self):
        self.loop.release(self.loop.stop_latch.number, self.now_us - LONG_AGO_US)

    def lose_encoders(self):
        self.silent = True

    def hear_encoders(self):
        self.silent = False

    def empty_battery(self):
        self.battery_v = 6.0
        self.wait(55)
        self.battery_v = 7.4

    def fall_silent(self):
        self.wait(16)

    def pause(self):
        """Keep the loop from running for longer than its watchdog waits."""
        self.now_us += 20 * TICK_US

    # States.

    def rest(self):
        """Nobody has commanded it."""

    def driving(self):
        for _ in range(15):
            self.begin()
            self.wait(4)
        self.begin()

    def ramping(self):
        self.driving()
        self.give_up()
        self.wait(2)
        assert self.loop.setpoint != REST

    def held(self):
        """Given up, the ramp over, and the wheels still turning: somebody pushes them."""
        self.driving()
        self.give_up()
        while self.loop.setpoint != REST:
            self.plant.drives.left_rad_per_s = self.plant.drives.right_rad_per_s = 5.0
            self.tick()
        assert self.duties != NO_DUTY

    def cut_off(self):
        self.driving()
        self.wait(18)
        assert self.loop.setpoint != REST

    def let_go(self):
        self.driving()
        self.wait(80)
        assert self.loop.setpoint == REST
        assert self.duties == NO_DUTY

    def stopped(self):
        self.driving()
        self.stop()

    def faulty(self):
        self.driving()
        self.empty_battery()
        assert self.loop.fault is Fault.BATTERY_LOW

    def deaf(self):
        self.driving()
        self.lose_encoders()
        while not self.loop.fault:
            self.go_on()
            self.tick()
        assert self.loop.fault is Fault.ENCODERS_SILENT

    def stopped_while_deaf(self):
        self.deaf()
        self.stop()


R, D, W, E, F = State
SAME = None
STATES = {
    "rest": R, "driving": D, "ramping": D, "held": D, "cut_off": W, "let_go": W,
    "stopped": E, "faulty": F, "deaf": F, "stopped_while_deaf": E,
}  # fmt: skip
EVENTS = {
    # After the event and one tick, in the order of the states above.
    "nothing":                    (R, D, D, D, W, W, E, F, F, E),
    "begin":                      (D, D, D, D, W, D, E, F, F, E),
    "go_on":                      (R, D, D, D, W, W, E, F, F, E),
    "give_up":                    (R, D, D, D, W, W, E, F, F, E),
    "begin_by_another":           (D, D, D, D, W, D, E, F, F, E),
    "fall_silent":                (R, W, R, R, W, W, E, F, F, E),
    "pause":                      (R, W, W, W, W, W, E, F, F, E),
    "stop":                       (E, E, E, E, E, E, E, E, E, E),
    "stop_long_ago":              (E, E, E, E, E, E, E, E, E, E),
    "release_of_another_stop":    (R, D, D, D, W, W, E, F, F, E),
    "release_long_ago":           (R, D, D, D, W, W, E, F, F, E),
    "release_now":                (R, D, D, D, W, W, R, R, R, R),
    "release_by_number_long_ago": (R, D, D, D, W, W, R, R, R, R),
    "lose_encoders":              (R, D, D, D, W, W, E, F, F, E),
    "hear_encoders":              (R, D, D, D, W, W, E, F, R, E),
    "empty_battery":              (F, F, F, F, F, F, E, F, F, E),
}  # fmt: skip


@pytest.mark.parametrize("kind", CONFIGS)
@pytest.mark.parametrize("event", EVENTS)
@pytest.mark.parametrize("state", STATES)
def test_every_state_times_every_event(kind, state, event):
    robot = Robot(kind)
    getattr(robot, state)()
    assert robot.loop.state is STATES[state]
    getattr(robot, event)()
    robot.tick()
    assert robot.loop.state is EVENTS[event][list(STATES).index(state)]


LIES = [None, (-1, 1), (1, -1), (-1, -1), (0, 1), (4, 4)]
"""By what each encoder's counts are multiplied."""
happenings = st.one_of(
    st.tuples(st.sampled_from(sorted(EVENTS)), st.just(None)),
    st.tuples(st.just("lie"), st.sampled_from(LIES)),
    st.tuples(st.just("wait"), st.integers(0, 40)),
)


@pytest.mark.parametrize("kind", CONFIGS)
@settings(max_examples=60)
@given(st.lists(happenings, max_size=30))
@example([("begin", None), ("wait", 10), ("lie", (-1, 1)), ("give_up", None), ("wait", 40)])
@example([("lie", (-1, -1)), ("begin", None), ("wait", 10), ("fall_silent", None), ("wait", 40)])
def test_whatever_happens_no_duty_is_given_at_rest_and_it_ends_there(kind, sequence):
    """The invariants of :meth:`Robot.check` hold in every tick; encoders may lie as they like."""
    robot = Robot(kind)
    for name, detail in sequence:
        if name == "lie":
            robot.lie = detail
        elif name == "wait":
            robot.wait(detail)
        else:
            getattr(robot, name)()
            robot.tick()
    loop = CONFIGS[kind].motor_loop
    limits = loop.limits
    ramp_s = max(
        limits.v_m_per_s / limits.a_m_per_s2, limits.omega_rad_per_s / limits.d_omega_rad_per_s2
    )
    robot.wait(round(100 * (loop.watchdog_s + ramp_s + LONGEST_HOLD_S)) + 2)
    for _ in range(50):
        robot.tick()
        assert robot.duties == NO_DUTY


@pytest.mark.parametrize("ending", ["give_up", "fall_silent"])
@pytest.mark.parametrize("kind", CONFIGS)
def test_wheels_that_somebody_pushes_are_held_for_a_while_and_then_let_go(kind, ending):
    """To the tick: a robot that is given up is at rest then, and its motors get nothing more."""
    robot = Robot(kind)
    robot.driving()
    getattr(robot, ending)()
    while robot.loop.setpoint != REST:
        robot.plant.drives.left_rad_per_s = robot.plant.drives.right_rad_per_s = 5.0
        robot.tick()
    for _ in range(round(100 * LONGEST_HOLD_S) - 1):
        robot.plant.drives.left_rad_per_s = robot.plant.drives.right_rad_per_s = 1.0
        assert robot.duties != NO_DUTY
        robot.tick()
    for _ in range(50):
        robot.plant.drives.left_rad_per_s = robot.plant.drives.right_rad_per_s = 1.0
        robot.tick()
        assert robot.duties == NO_DUTY
        assert robot.loop.state is (State.REST if ending == "give_up" else State.WATCHDOG)
    assert robot.command(robot.u, CONTROLLER, sequence=0) is None


@pytest.mark.parametrize("kind", CONFIGS)
def test_a_robot_that_is_given_up_and_stands_is_at_rest_at_once(kind):
    robot = Robot(kind)
    robot.u = tuple(2.0 * u for u in robot.u)
    robot.driving()
    robot.give_up()
    ticks = 0
    while robot.loop.state is State.DRIVING:
        robot.tick()
        ticks += 1
    assert ticks > 100 * CONFIGS[kind].motor_loop.watchdog_s, "nothing more needs to be said"
    assert robot.loop.state is State.REST
    assert robot.loop.odometry.newest() == (0.0, 0.0)


@pytest.mark.parametrize("watchdog_s", [0.1, 0.15, 0.25])
@pytest.mark.parametrize("kind", CONFIGS)
def test_the_watchdog_acts_in_the_first_tick_that_is_later_than_its_time(kind, watchdog_s):
    robot = Robot(kind)
    robot.loop = type(robot.loop)(
        load_config(robot=kind, overrides=[f"motor_loop.watchdog_s={watchdog_s}"])
    )
    robot.driving()
    robot.wait(3)
    robot.begin()
    accepted_us = robot.now_us
    while robot.loop.state is State.DRIVING:
        robot.tick()
    # The tick that found it silent; the bench has moved on to the time of the next one.
    assert robot.now_us - TICK_US - accepted_us == round(watchdog_s * 1e6) + TICK_US
    assert robot.loop.arbiter.holder == NOBODY


@pytest.mark.parametrize("kind", CONFIGS)
def test_a_refused_command_keeps_nobody_awake(kind):
    robot = Robot(kind)
    robot.driving()
    for _ in range(20):
        robot.command(robot.u, sequence=0, intent=Intent.CONTINUE)
        robot.command(robot.u, CONTROLLER)
        robot.tick()
    assert robot.loop.state is State.WATCHDOG


@pytest.mark.parametrize("kind", CONFIGS)
def test_an_emergency_stop_is_no_fault_that_heals(kind):
    """It is pressed while the encoders are silent, and they are heard again."""
    robot = Robot(kind)
    robot.stopped_while_deaf()
    robot.hear_encoders()
    robot.wait(100)
    assert robot.loop.state is State.ESTOP
    robot.release_by_number_long_ago()
    robot.tick()
    assert robot.loop.state is State.REST

"""Whatever a stamp says, what takes it does little, raises nothing, and goes on with good ones.

Every component that computes with stamps of others is fed hostile and good ones in any order. Its
work is counted in calls, so that no loop, window or buffer can hang on a stamp.
"""

from types import SimpleNamespace
from typing import NamedTuple

import numpy as np
import pytest
from hostile.times import HOSTILE, at_most_calls
from hypothesis import given, settings
from hypothesis import strategies as st

import lcmtypes
from koopman_lab.bus.publishers import Publishers
from koopman_lab.bus.replay_guard import OrderGuard, StreamGuard
from koopman_lab.bus.stamp_gate import INLETS
from koopman_lab.config.load import load_config
from koopman_lab.geometry.planar import ORIGIN, REST, Pose, Velocity
from offboard.controller.delay import LONGEST_S, LoopDelay
from offboard.controller.estimate import StateEstimator
from offboard.controller.input_history import MEMORY_S, InputHistory
from offboard.desk.camera_stream import CameraStream
from offboard.desk.guard import Guard
from offboard.desk.measurements import Frame, WheelSpeeds
from offboard.monitor.lab_view import LabView
from onboard.motor_loop.command_arbiter import Command, CommandArbiter, Intent
from onboard.motor_loop.loop import MotorLoop
from onboard.motor_loop.odometry import Odometry
from onboard.motor_loop.stop_latch import StopLatch
from onboard.plant.cameras.watched_robot import WatchedRobot
from onboard.time_sync import Exchange, TimeSync

CONFIG = load_config(robot="dynamic")
START_US = 1_700_000_000_000_000
STEP_US = 50_000
MOST_CALLS = 1500
"""In a step; the honest ones make up to a few hundred, 5 s in pieces of 50 ms a hundred more."""


class At(NamedTuple):
    """A stamp that arrives now (us), in the k-th step."""

    stamp: int
    now: int
    k: int


def stand(x, _):
    """Predict that nothing moves."""
    return x


def arbiter():
    """Take commands, as the board does."""
    takes = CommandArbiter(CONFIG)
    return lambda at: takes.consider(
        Command(at.stamp, at.k, 1, Intent.BEGIN, 0.1, 0.1), at.now, ready=True
    )


def latch():
    """Take stops and releases, as the board does."""
    takes = StopLatch()

    def feed(at):
        takes.engage(at.now, at.stamp)
        takes.release(0, at.stamp)

    return feed


def odometry():
    """Take encoder counters, also those that no gate would let through."""
    takes = Odometry(2400, 0.05)

    def feed(at):
        takes.update(at.stamp, at.k, at.k)
        takes.mean()

    return feed


def motor_loop():
    """Run the whole loop of the board."""
    loop = MotorLoop(CONFIG)

    def feed(at):
        loop.encoder(at.stamp, 10 * at.k, 10 * at.k, 7.4)
        loop.command(Command(at.stamp, at.k, 1, Intent.BEGIN, 0.1, 0.1), at.now)
        duties = loop.tick(at.now)
        assert all(abs(duty) <= 1.0 for duty in duties)

    return feed


def time_sync():
    """Take answers to the board's pings, wrong in each of their three times."""
    sync = TimeSync(CONFIG.clock)

    def feed(at):
        sync.add(Exchange(at.stamp, at.now, at.now, at.now))
        sync.add(Exchange(at.now - 2000, at.stamp, at.stamp, at.now))
        sync.add(Exchange(at.now - 2000, at.now, at.stamp, at.now))
        assert -(2**63) <= sync.to_desk(at.now) < 2**63
        sync.to_board(at.stamp)

    return feed


def stream_identity():
    """Take numbers and stamps of a stream."""
    takes = Publishers()

    def feed(at):
        takes.take(at.k, at.stamp, at.now)
        takes.take(at.stamp, at.stamp, at.now)
        takes.identity(at.now)

    return feed


def replay_guards():
    """Keep a log off the hardware."""
    guards = StreamGuard(), OrderGuard()
    return lambda at: [guard.accepts(at.stamp, at.now) for guard in guards]


def guard():
    """Take frames, wheels and set-points, as who drives does."""
    takes = Guard(CONFIG, 0.5)

    def feed(at):
        takes.see_wheels(WheelSpeeds(at.stamp, Velocity(0.1, 0.0)))
        takes.see_setpoint(Velocity(0.1, 0.0), at.now)
        takes.see_frames(
            [Frame(at.stamp, Pose(0.001 * at.k, 0.0, 0.0), True)], at.now, driving=True
        )
        interlock = takes.interlock(at.now, driving=True)
        assert interlock is None or interlock.reason

    return feed


def camera_stream():
    """Take frames that are recorded."""
    takes = CameraStream("R1_MOCAP_POSE", 240.0)

    def feed(at):
        takes.take([SimpleNamespace(utime=at.stamp, sequence=at.k)])
        takes.complaint()

    return feed


def estimator():
    """Estimate the state to plan from, by a walk over the inputs until now."""
    takes = StateEstimator(CONFIG, ORIGIN, stand)

    def feed(at):
        wheels = WheelSpeeds(at.stamp, Velocity(0.1, 0.0))
        takes.update([Frame(at.stamp, Pose(0.0, 0.0, 0.0), True)], wheels, at.now)
        takes.apply(np.zeros(2), at.now)
        takes.state(at.now)
        takes.move_goal(ORIGIN)

    return feed


def inputs_from_stamps():
    """Walk over the inputs between any two times."""
    history = InputHistory(2)

    def feed(at):
        history.add(at.now, np.zeros(2))
        for pair in ((at.stamp, at.now), (at.now, at.stamp), (at.stamp, at.stamp)):
            pieces = sum(1 for _ in history.between(*pair, 0.05))
            assert pieces <= MEMORY_S / 0.05 + 102

    return feed


def loop_delay():
    """Take the round trip that the board says it measured."""
    takes = LoopDelay(CONFIG)

    def feed(at):
        takes.set_round_trip(at.stamp)
        assert 0.0 < takes.estimate_s() <= LONGEST_S

    return feed


def watched_robot():
    """See a robot in another process, as simulated cameras do."""
    takes = WatchedRobot()

    def feed(at):
        truth = lcmtypes.plant_truth_t()
        truth.utime, truth.v_m_per_s = at.stamp, 0.3
        takes.take(truth, at.now)
        utime, pose, _ = takes.look(at.now)
        assert utime == at.now
        assert abs(pose[0]) < 1.0

    return feed


def page():
    """Show all that is said."""
    view = LabView(CONFIG)

    def feed(at):
        for suffix, message_type in (
            ("MOCAP_POSE", lcmtypes.mocap_pose_t),
            ("WHEEL_STATE", lcmtypes.wheel_state_t),
            ("ONBOARD_STATUS", lcmtypes.onboard_status_t),
            ("PLANT_HEARTBEAT", lcmtypes.node_status_t),
        ):
            message = message_type()
            message.utime, message.sequence = at.stamp, at.k
            view.take(f"R1_{suffix}", message.encode(), at.now)

    feed(At(START_US, START_US, 0))  # what is made once for all messages of a type
    return feed


COMPONENTS = {
    f.__name__: f
    for f in (
        *(arbiter, latch, odometry, motor_loop, time_sync, stream_identity, replay_guards, guard),
        *(camera_stream, estimator, inputs_from_stamps, loop_delay, watched_robot, page),
    )
}


def feed_all(name, stamps):
    feed = COMPONENTS[name]()
    for k, stamp_of in enumerate(stamps):
        now_us = START_US + k * STEP_US
        stamp = max(-(2**63), min(2**63 - 1, stamp_of(now_us)))
        with at_most_calls(MOST_CALLS):
            feed(At(stamp, now_us, k))


def good(now_us):
    return now_us - 4000


@pytest.mark.parametrize("what", HOSTILE)
@pytest.mark.parametrize("name", COMPONENTS)
def test_each_hostile_time_alone_among_good_ones_and_again_and_again(name, what):
    hostile = HOSTILE[what]
    feed_all(name, [*[good] * 10, hostile, *[good] * 10, *[hostile] * 10, *[good] * 3])


@pytest.mark.parametrize("name", COMPONENTS)
@settings(max_examples=25)
@given(
    stamps=st.lists(
        st.one_of(
            st.just(good),
            st.sampled_from(list(HOSTILE.values())),
            st.integers(-(2**63), 2**63 - 1).map(lambda stamp: lambda _: stamp),
            st.integers(-(10**8), 10**8).map(lambda off: lambda now: now + off),
        ),
        max_size=40,
    )
)
def test_times_in_any_order_make_little_work(name, stamps):
    feed_all(name, stamps)


def test_a_frame_of_an_hour_ahead_hides_none_that_follow():
    """It is dropped: those that come after it are believed as if it had not been."""
    takes = Guard(CONFIG, 0.5)
    for k in range(40):
        now_us = START_US + k * STEP_US
        frames = [Frame(good(now_us), Pose(0.0, 0.0, 0.0), True)]
        if k == 20:
            takes.see_frames(
                [Frame(HOSTILE["an hour ahead"](now_us), Pose(0, 0, 0), True)], now_us, driving=True
            )
        believed = takes.see_frames(frames, now_us, driving=True)
        assert believed == frames[0]


def test_the_gates_are_no_wider_than_the_memory_of_the_inputs():
    widest_us = max(max(inlet.ahead_us, inlet.behind_us) for inlet in INLETS.values())
    assert widest_us <= MEMORY_S * 1e6
    assert Velocity(0.0, 0.0) == REST

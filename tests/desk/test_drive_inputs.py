"""What a node that drives hears on the real bus in lockstep, and what keeps it from driving."""

import math
from itertools import pairwise

import pytest
from drive_inputs_bench import STATUS, Bench, Driver, Speakers

import lcmtypes
from koopman_lab.bus import channels
from koopman_lab.bus.admission import Admission
from koopman_lab.bus.lab_key import KEY_BYTES
from koopman_lab.bus.lockstep import Lockstep
from koopman_lab.config.load import load_config
from koopman_lab.geometry.planar import Pose
from offboard.desk.commander import Commands
from offboard.desk.drive_inputs import DriveInputs
from offboard.desk.guard import Guard
from offboard.desk.interlock import Cause
from offboard.desk.orders import TRIES, stop_order

COMMANDER, OTHER = 2 + 8 * 100, 2 + 8 * 200


@pytest.mark.parametrize("records", [True, False])
def test_a_robot_of_which_all_is_known_may_be_driven_and_it_is_waited_for(records):
    bench = Bench(records=records)
    assert bench.after(0.5) is not None
    assert bench.after(1.5) is None
    assert bench.driver.inputs.tracked(bench.lab.now_us).pose.x1 == pytest.approx(0.3, abs=1e-3)
    assert bench.driver.inputs.frame.pose.theta == 0.0


def change(**values):
    return lambda speakers: vars(speakers).update(values)


def state(**values):
    return lambda speakers: [
        setattr(speakers.status, name, value) for name, value in values.items()
    ]


def silence(channel):
    return lambda speakers: speakers.silent.add(channel.suffix)


def stick(speakers):
    speakers.stuck_us = speakers.status.utime


@pytest.mark.parametrize(
    ("what", "reason", "cause", "lasting", "records"),
    [
        (silence(channels.ONBOARD_STATUS), "onboard loop silent", Cause.SILENCE, False, False),
        (stick, "onboard loop silent", Cause.SILENCE, False, False),
        (change(stuck_us=40_000_000), "onboard loop silent", Cause.SILENCE, False, False),
        (silence(channels.LOGGER_STATUS), "logger silent", Cause.SILENCE, False, False),
        (
            change(logged_bytes=lcmtypes.logger_status_t.NOT_WRITING),
            "logger cannot write",
            Cause.RECORD,
            True,
            False,
        ),
        (state(state=STATUS.ESTOP), "emergency stop", Cause.HELD, True, False),
        (
            state(state=STATUS.FAULT, fault=STATUS.BATTERY_LOW),
            "stopped: battery low",
            Cause.HELD,
            True,
            False,
        ),
        (state(commander=OTHER), "held by controller", Cause.HELD, True, False),
        (silence(channels.MOCAP_POSE), "no camera frames", Cause.TRACKING, False, False),
        (change(valid=False), "do not see the robot", Cause.TRACKING, False, False),
        (
            change(ahead_us=30_000_000),
            "s ahead of this computer's clock",
            Cause.TRACKING,
            False,
            False,
        ),
        (change(ahead_us=-3_000_000), "s behind", Cause.TRACKING, False, False),
        (change(rate_hz=120), "frames a second", Cause.STREAM, False, True),
        (change(twice=True), "R1_MOCAP_POSE", Cause.STREAM, False, False),
    ],
)
def test_whatever_is_missing_keeps_it_from_being_driven(what, reason, cause, lasting, records):
    bench = Bench(records=records)
    assert bench.after(2.0) is None
    what(bench.speakers)
    interlock = bench.after(6.0)
    assert reason in interlock.reason
    assert (interlock.cause, interlock.lasting) == (cause, lasting)


def without_key(bench, channel):
    """Have a channel's messages judged by a key that none of them carries."""
    bench.lab.close()
    name = channel.name("R1")
    subscription = bench.driver.port.subscriptions[name]
    admission = subscription.admission = Admission(bytes(KEY_BYTES), channel, name)
    take = subscription.receive
    routes = bench.lab.routes[name]
    routes[:] = [
        (order, lambda data, at: admission.admits(data) and take(data, at)) for order, _ in routes
    ]


@pytest.mark.parametrize(
    ("channel", "reason"),
    [(channels.ONBOARD_STATUS, "onboard loop silent"), (channels.LOGGER_STATUS, "logger silent")],
)
def test_who_is_silent_for_want_of_the_key_is_told_from_who_is_not_there(channel, reason):
    bench = Bench(records=False)
    assert bench.after(2.0) is None
    without_key(bench, channel)
    interlock = bench.after(4.0)
    assert interlock.reason == f"{reason}; messages without the lab's key on {channel.name('R1')}"
    assert interlock.cause is Cause.SILENCE
    bench.speakers.silent.add(channel.suffix)
    assert bench.after(4.0).reason == reason


def test_who_drives_alone_does_not_care_for_the_rate():
    bench = Bench(records=False)
    bench.speakers.rate_hz = 120
    assert bench.after(6.0) is None


def test_the_commander_itself_may_hold_the_robot():
    bench = Bench()
    bench.speakers.status.commander = COMMANDER
    assert bench.after(2.0) is None


def test_why_is_said_at_once_now_and_then_and_once_more_when_it_is_over():
    bench = Bench()
    bench.after(2.0)
    bench.driver.told.clear()
    began_us = bench.lab.now_us
    bench.speakers.valid = False
    bench.after(2.9)
    bench.speakers.valid = True
    bench.after(1.0)
    told = bench.driver.told
    reasons = [reason for _, reason, _ in told]
    assert set(reasons[:-1]) == {"tracking lost: the cameras do not see the robot"}
    assert reasons[-1] == ""
    steps_s = [round((b[0] - a[0]) * 1e-6, 2) for a, b in pairwise(told[:-1])]
    assert steps_s == [0.5] * len(steps_s)
    assert 0.5 <= (told[0][0] - began_us) * 1e-6 <= 0.7
    assert len(told) == 6
    assert not any(lasting for _, _, lasting in told)


def test_valid_frames_are_counted_where_they_are_recorded():
    bench = Bench()
    bench.after(1.0)
    assert bench.driver.inputs.valid_frames == 12
    bench.speakers.valid = False
    bench.after(0.1)
    assert bench.driver.inputs.valid_frames == 0


def test_a_known_marker_offset_is_taken_out():
    config = load_config(robot="kinematic")
    lab, speakers = Lockstep(config), Speakers()
    seen = {}

    class Node(Driver):
        def attach(self, port):
            offset = Pose(0.1, 0.0, math.pi / 2)
            seen["inputs"] = self.inputs = DriveInputs(
                port,
                config,
                Guard(config, 0.5),
                Commands(port, config, self.name),
                marker_offset=offset,
            )
            self.port = port
            port.every(20.0, self.tick)

    lab.add(speakers)
    lab.add(Node(config, records=False))
    lab.run(1.0)
    # Seen from the tracked frame, which is turned to the left, the robot is to its left.
    pose = seen["inputs"].frame.pose
    assert (pose.x1, pose.x2) == pytest.approx((0.3, 0.1), abs=1e-3)
    assert pose.theta == pytest.approx(-math.pi / 2)


class Sent:
    """What an order is sent by."""

    def __init__(self):
        self.messages = []

    def publish(self, channel, message):
        self.messages.append((channel, message.engaged))

    def now_us(self):
        return 7


@pytest.mark.parametrize("release", [False, True])
def test_an_order_is_sent_until_it_is_obeyed_or_for_long_enough(release):
    status, sender = STATUS(), Sent()
    status.state = STATUS.ESTOP if release else STATUS.DRIVING
    order = stop_order(lambda: status, release=release)
    assert [order.step(sender) for _ in range(3)] == [None] * 3
    assert set(sender.messages) == {(channels.ESTOP, not release)}
    status.state = STATUS.REST if release else STATUS.ESTOP
    assert order.step(sender) is True
    assert len(sender.messages) == 3
    silent = stop_order(lambda: None, release=release)
    assert [silent.step(sender) for _ in range(TRIES + 1)] == [None] * TRIES + [False]

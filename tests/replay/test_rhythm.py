"""When a replay sends what; the bus itself is tested through the command."""

import pytest

from koopman_lab.eventlog.eventlog import Event
from koopman_lab.replay.playback import Playback
from koopman_lab.replay.timed_replay import Replay, clock_us, rhythm

HOUR_US = 3_600_000_000


class Bus:
    def __init__(self):
        self.sent = []

    def publish(self, channel, data):
        self.sent.append((channel, data))


@pytest.mark.parametrize(
    ("timestamps_us", "due_us", "jumps"),
    [
        ([], [], 0),
        ([7], [0], 0),
        ([100, 150, 150, 400], [0, 50, 50, 300], 0),
        # A clock set back, and set forward by more than a pause.
        ([100, 150, 20, 60], [0, 50, 50, 90], 1),
        ([0, 10, HOUR_US, HOUR_US + 5], [0, 10, 10, 15], 1),
        # A damaged time: away and back.
        ([100, 110, -(2**62), 130], [0, 10, 10, 10], 2),
    ],
)
def test_the_rhythm_is_the_logs_except_where_its_clock_was_set(timestamps_us, due_us, jumps):
    assert rhythm(timestamps_us) == (due_us, jumps)


@pytest.mark.parametrize("speed", [1.0, 4.0, 1000.0])
def test_events_are_sent_in_order_and_never_before_their_time(speed):
    events = [Event(i, 0, f"R1_{i % 3}", bytes([i])) for i in range(20)]
    due_us = [5_000 * i for i in range(20)]
    bus, told = Bus(), []
    made_us = clock_us() - 10_000_000  # what takes time before the first message delays them all
    done = Replay(events, Playback(due_us, made_us, speed=speed), bus).run(told.append)
    assert bus.sent == [(event.channel, event.data) for event in events]
    assert done.events == 20
    assert done.took_s >= 0.095 / speed
    assert told == sorted(told)
    assert told[-1] == 0.095


def test_the_present_is_what_each_channel_said_last_and_no_order_of_a_person():
    names = ("R1_MOCAP_POSE", "R1_GOAL", "OTHER", "R1_MOCAP_POSE", "R1_WHEEL_STATE", "OTHER")
    events = [Event(k, 0, name, bytes([k])) for k, name in enumerate(names)]
    playback, bus = Playback([10 * k for k in range(6)], 0, paused=True), Bus()
    replay = Replay(events, playback, bus)
    replay.show_present()
    assert bus.sent == []
    playback.seek(45, 0)
    replay.show_present()
    assert bus.sent == [
        ("OTHER", b"\2"),
        ("R1_MOCAP_POSE", b"\3"),
        ("R1_WHEEL_STATE", b"\4"),
    ]


def test_who_steers_while_it_waits_pauses_and_ends_it():
    events, bus = [Event(k, 0, "OTHER", bytes([k])) for k in range(3)], Bus()
    playback = Playback([0, 10, 3_600_000_000], clock_us(), paused=True)
    waits = []

    def wait(timeout_s):
        assert 0.0 <= timeout_s <= 0.2
        waits.append(len(bus.sent))
        if len(waits) == 3:
            playback.set_playing(True, clock_us())
        elif playback.playing and len(bus.sent) == 2:
            playback.seek(3_600_000_000, clock_us())

    done = Replay(events, playback, bus).run(lambda _: None, wait)
    assert waits[:3] == [0, 0, 0]
    assert [data for _, data in bus.sent] == [b"\0", b"\1", b"\2"]
    assert done.events == 3

"""When a replay sends what; the bus itself is tested through the command."""

import pytest

from koopman_lab.eventlog.eventlog import Event
from koopman_lab.replay.timed_replay import replay, rhythm

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
    done = replay(events, due_us, bus, speed, told.append)
    assert bus.sent == [(event.channel, event.data) for event in events]
    assert done.events == 20
    assert done.took_s >= 0.095 / speed
    assert told == sorted(told)
    assert told[-1] == 0.095

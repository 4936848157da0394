import pytest
from hypothesis import given
from hypothesis import strategies as st

import lcmtypes
from koopman_lab.bus import channels
from koopman_lab.bus.port import BasePort, Timer
from koopman_lab.bus.sequence import SequenceCounter
from koopman_lab.config.load import load_config
from koopman_lab.errors import BusError

CONFIG = load_config()


class Loop(BasePort):
    """A port that hears itself."""

    virtual = True

    def __init__(self):
        super().__init__("plant", CONFIG, process=0)
        self.sent = []

    def bus_us(self):
        return 0

    def send(self, name, data):
        self.sent.append((name, data))

    def deliver_at(self, at_us, take, data):
        take(data, at_us)


def test_late_ticks_are_skipped_and_counted_never_caught_up():
    ran = []
    timer = Timer(100.0, ran.append)
    for now in (0, 10_000, 20_100, 57_000, 60_000, 70_000):
        if timer.deadline_us <= now:
            timer.fire(now)
    assert ran == [0, 10_000, 20_000, 50_000, 60_000, 70_000]
    assert (timer.ticks_run, timer.missed) == (6, 2)


@given(st.integers(1, 1000), st.integers(0, 10**12), st.lists(st.booleans(), max_size=200))
def test_deadlines_do_not_drift(rate_hz, start_us, skips):
    timer = Timer(float(rate_hz), lambda _: None)
    timer.start(start_us)
    period_us = 1_000_000 // rate_hz
    for skip in skips:
        timer.fire(timer.deadline_us + skip * 7 * period_us)
    drift = (timer.deadline_us - start_us) * rate_hz - (timer.ticks_run + timer.missed) * 1_000_000
    assert abs(drift) <= rate_hz / 2 + 1e-3


@given(st.lists(st.booleans(), min_size=1))
def test_gaps_are_counted_exactly_up_to_the_last_message_received(received):
    counter = SequenceCounter()
    for sequence, arrived in enumerate(received):
        if arrived:
            counter.update(sequence)
    numbers = [i for i, arrived in enumerate(received) if arrived]
    lost = numbers[-1] - numbers[0] + 1 - len(numbers) if numbers else 0
    assert counter.lost == lost


def test_a_publisher_that_starts_again_is_no_loss():
    counter = SequenceCounter()
    assert [counter.update(n) for n in (7, 8, 0, 1, 4)] == [0, 0, 0, 0, 2]


@given(
    st.lists(st.tuples(st.sampled_from(["older", "younger"]), st.booleans()), max_size=200),
    st.integers(300, 1000),
    st.booleans(),
)
def test_two_that_speak_at_once_miss_only_what_is_lost(story, ahead, older_is_first):
    counter, said = SequenceCounter(), {"older": ahead, "younger": 2}
    for sequence in (ahead - 1, 0, 1) if older_is_first else (0, ahead - 1, 1):
        counter.update(sequence)
    lost, unnoticed = 0, {"older": 0, "younger": 0}
    for who, arrives in story:
        if arrives:
            counter.update(said[who])
            lost, unnoticed[who] = lost + unnoticed[who], 0
        else:
            unnoticed[who] += 1
        said[who] += 1
    assert (counter.lost, counter.restarts) == (lost, 1)


@given(st.permutations(range(10)), st.integers(1, 1000))
def test_what_was_overtaken_or_came_twice_is_no_loss(order, start):
    counter = SequenceCounter()
    for sequence in (start - 1, start - 1, *(start + n for n in order), start + 10, start + 10):
        counter.update(sequence)
    assert counter.lost == 0


def test_messages_are_numbered_per_channel():
    port = Loop()
    for _ in range(3):
        port.publish(channels.ENCODER, lcmtypes.encoder_t())
    port.publish(channels.MOCAP_POSE, lcmtypes.mocap_pose_t())
    numbers = [lcmtypes.encoder_t.decode(d).sequence for n, d in port.sent if n == "R1_ENCODER"]
    assert numbers == [0, 1, 2]
    assert lcmtypes.mocap_pose_t.decode(port.sent[-1][1]).sequence == 0


@given(st.binary(max_size=80))
def test_no_bytes_make_a_port_raise(data):
    port = Loop()
    seen = []
    port.subscribe(channels.ENCODER, seen.append)
    port.subscriptions["R1_ENCODER"].arrive(data, 0)
    assert port.undecodable == 1
    assert not seen


def test_names_split_back_into_robot_and_row():
    for channel in channels.CHANNELS:
        assert channels.split_name(channel.name("R12")) == ("R12", channel)
    for name in ("R1_NOTHING", "MOCAP_POSE", "_MOCAP_POSE", ""):
        with pytest.raises(BusError, match="MOCAP_POSE"):
            channels.split_name(name)

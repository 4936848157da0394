"""A replay steered by messages, by plain calls; the bus itself is tested through the command."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from koopman_lab.replay.bus_steering import BusSteering, Control, control_message
from koopman_lab.replay.playback import FASTEST, Playback
from lcmtypes import replay_control_t

SECOND_US = 1_000_000


class Bench:
    """A replay of 10 s on a clock that is set by hand, and what it said."""

    def __init__(self):
        self.clock_us, self.said, self.shown = 0, [], 0
        self.playback = Playback([0, 10 * SECOND_US], 0, paused=True)
        self.steering = BusSteering(self.playback, lambda: self.clock_us, self.show)
        self.steering.attach(self)

    def show(self):
        self.shown += 1

    def now_us(self):
        return self.clock_us

    def publish(self, channel, message):
        del channel
        self.said.append(message)

    def ask(self, number, action, value=0.0):
        utime = max(number, self.clock_us)
        self.steering.take(control_message(Control(action, value), number, utime))


def test_the_state_is_said_several_times_a_second_and_at_once_when_it_changes():
    bench = Bench()
    for bench.clock_us in range(0, 2 * SECOND_US, 10_000):
        bench.steering.say_state_if_due()
    assert len(bench.said) == 10
    bench.ask(1, replay_control_t.SEEK, 4.0)
    state = bench.said[-1]
    assert len(bench.said) == 11
    assert (state.position_s, state.end_s, state.control, state.seeks) == (4.0, 10.0, 1, 1)
    assert bench.shown == 1


def test_each_action_does_what_it_says():
    bench, kind = Bench(), replay_control_t
    bench.ask(1, kind.PLAY)
    assert bench.said[-1].playing
    bench.ask(2, kind.SPEED, 4.0)
    bench.clock_us = SECOND_US
    bench.ask(3, kind.PAUSE)
    assert not bench.said[-1].playing
    assert (bench.said[-1].position_s, bench.said[-1].speed) == (4.0, 4.0)


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_what_is_no_number_is_passed_over(value):
    bench = Bench()
    bench.ask(1, replay_control_t.SEEK, value)
    bench.ask(2, replay_control_t.SPEED, value)
    assert (bench.said, bench.shown) == ([], 0)


@given(
    st.lists(
        st.tuples(
            st.integers(-(2**63), 2**63 - 1),
            st.integers(-128, 127),
            st.floats(allow_nan=True, allow_infinity=True),
        )
    )
)
def test_whatever_a_stranger_says_each_number_counts_once_and_the_replay_stays_whole(messages):
    bench, obeyed = Bench(), 0
    for number, action, value in messages:
        count = len(bench.said)
        bench.ask(number, action, value)
        if number <= obeyed or not math.isfinite(value):
            assert len(bench.said) == count
            continue
        obeyed = number
        assert bench.said[-1].control == number
        assert 0.0 <= bench.said[-1].position_s <= 10.0
        assert 0.0 < bench.playback.speed <= FASTEST


@given(st.integers(0, 10**15), st.integers(1, 2**62))
def test_nobody_asks_for_anything_after_it_was_sent_and_so_locks_others_out(utime, later_us):
    bench = Bench()
    bench.steering.take(control_message(Control(replay_control_t.PLAY), utime + later_us, utime))
    assert not bench.playback.playing
    bench.ask(1, replay_control_t.PLAY)
    assert bench.playback.playing

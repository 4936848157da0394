"""Which of two senders of a stream is followed, and which orders are of now."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from koopman_lab.bus.age import is_current
from koopman_lab.bus.channels import CHANNELS
from koopman_lab.bus.replay_guard import (
    LOG_US,
    SAME_SENDER_US,
    SILENCE_US,
    OrderGuard,
    StreamGuard,
    guard_of,
)
from koopman_lab.units import US_PER_S

NOW_US = 1_800_000_000 * US_PER_S
TICK_US = 10_000
clocks = st.integers(-(10**9), 10**9)
"""How far a sender's clock is ahead (us): up to some 17 min."""


@given(st.integers(), st.integers(), st.integers(0, 10**15))
def test_age_counts_both_ways(at_us, now_us, limit_us):
    assert is_current(at_us, now_us, limit_us) == is_current(now_us, at_us, limit_us)
    assert is_current(at_us, at_us, limit_us)
    assert is_current(now_us + limit_us, now_us, limit_us)
    assert not is_current(now_us + limit_us + 1, now_us, limit_us)
    assert not is_current(now_us - limit_us - 1, now_us, limit_us)


@given(clocks, st.integers(-(10**16), 10**16), st.lists(st.booleans(), min_size=1, max_size=50))
def test_beside_a_live_sender_a_log_is_passed_over_whoever_came_first(ahead_us, age_us, story):
    """A log lies farther from now than the worst clock, in the past or, by its clock, ahead."""
    if abs(age_us) <= abs(ahead_us) + SAME_SENDER_US:
        age_us = (abs(ahead_us) + SAME_SENDER_US + 1) * (-1 if age_us < 0 else 1)
    guard, live_heard = StreamGuard(), False
    for k, live in enumerate(story):
        now_us = NOW_US + k * TICK_US // 10
        taken = guard.accepts(now_us + (ahead_us if live else -age_us), now_us)
        assert taken == (live or not live_heard)
        live_heard = live_heard or live


@given(clocks, clocks)
def test_a_sender_whose_clock_was_set_is_followed_at_once_or_after_a_silence(before_us, after_us):
    guard = StreamGuard()
    assert guard.accepts(NOW_US + before_us, NOW_US)
    taken = []
    for k in range(1, 8):
        now_us = NOW_US + k * TICK_US
        taken.append(guard.accepts(now_us + after_us, now_us))
    closer = abs(after_us) < abs(before_us) or abs(after_us - before_us) <= SAME_SENDER_US
    assert taken == [closer or k * TICK_US >= SILENCE_US for k in range(1, 8)]


@given(st.integers(-(10**16), 10**16))
def test_an_order_is_of_now_or_a_logs(age_us):
    assert OrderGuard().accepts(NOW_US - age_us, NOW_US) == (abs(age_us) <= LOG_US)


@pytest.mark.parametrize("channel", CHANNELS, ids=lambda channel: channel.suffix)
def test_what_moves_the_robot_by_wire_or_by_hand_is_guarded(channel):
    by_wire = channel.suffix in ("ENCODER", "MOTOR_CMD")
    by_hand = channel.suffix in ("PLANT_RESET", "FAULT", "REPLAY_CONTROL")
    kind = StreamGuard if by_wire else OrderGuard if by_hand else type(None)
    assert isinstance(guard_of(channel.replayed), kind)

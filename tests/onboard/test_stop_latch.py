"""Which releases are meant for the stop that holds the robot; no clock, no bus."""

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from onboard.motor_loop.stop_latch import NO_STOP, StopLatch

INT64 = st.integers(-(2**63), 2**63 - 1)
STOPPED_US = 5_000_000


def stopped(now_us=STOPPED_US, ordered_us=STOPPED_US):
    latch = StopLatch()
    latch.engage(now_us, ordered_us)
    return latch


@given(INT64, INT64, INT64)
def test_a_release_that_names_the_stop_counts_whatever_any_clock_says(now, ordered, released):
    latch = stopped(now, ordered)
    assert latch.number != NO_STOP
    assert latch.release(latch.number, released)
    assert latch.number == NO_STOP
    assert latch.refused_releases == 0


@given(INT64, INT64, INT64)
def test_a_release_of_another_stop_is_refused_and_counted(now, number, released):
    latch = stopped(now, now)
    assume(number not in (NO_STOP, latch.number))
    held = latch.number
    assert not latch.release(number, released)
    assert latch.number == held
    assert latch.refused_releases == 1


@given(INT64, INT64)
def test_a_release_without_a_number_counts_from_the_time_of_the_stop_on(ordered, released):
    """A stop of the future is one of now: no time, however wrong, makes it stop for good."""
    latch = stopped(ordered_us=ordered)
    assert latch.release(NO_STOP, released) is (released >= min(ordered, STOPPED_US))


def test_each_stop_is_one_of_its_own_also_while_another_holds():
    latch = stopped()
    first = latch.number
    latch.engage(STOPPED_US + 1, STOPPED_US + 1)
    assert latch.number != first
    assert not latch.release(first, STOPPED_US + 2)
    assert latch.release(latch.number, 0)


def test_a_stop_of_a_replayed_log_does_not_let_its_own_release_undo_that_of_a_person():
    latch, hour_us = stopped(), 3_600_000_000
    latch.engage(STOPPED_US + 1, STOPPED_US - hour_us)
    assert not latch.release(NO_STOP, STOPPED_US - hour_us + 1)
    assert latch.release(NO_STOP, STOPPED_US)


@pytest.mark.parametrize("number", [NO_STOP, STOPPED_US])
def test_nothing_is_released_or_refused_while_nothing_holds_the_robot(number):
    latch = stopped()
    assert latch.release(latch.number, 0)
    assert not latch.release(number, STOPPED_US + 1)
    assert latch.refused_releases == 0

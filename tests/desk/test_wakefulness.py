"""A program that stood still says so, however long it slept and whatever it did before."""

import time

from hypothesis import given
from hypothesis import strategies as st

from koopman_lab.bus.realtime_port import Clock
from offboard.desk.wakefulness import Wakefulness

LIMIT_S, LIMIT_US = 2.0, 2_000_000


@given(st.lists(st.integers(0, 3 * LIMIT_US), max_size=30), st.integers(0, 2**50))
def test_the_first_gap_over_the_limit_is_named_and_stays(gaps_us, now_us):
    wakefulness, expected = Wakefulness(LIMIT_S), None
    wakefulness.step(now_us)
    for gap_us in gaps_us:
        now_us += gap_us
        wakefulness.step(now_us)
        if gap_us > LIMIT_US:
            expected = f"stood still for {gap_us * 1e-6:.1f} s"
        if expected is None:
            assert wakefulness.complaint is None
        else:
            assert expected in wakefulness.complaint


def test_thirty_seconds_are_named_with_the_next_step():
    wakefulness = Wakefulness(LIMIT_S)
    wakefulness.step(1_000_000)
    wakefulness.step(31_000_000)
    assert "stood still for 30.0 s" in wakefulness.complaint
    assert "then start again" in wakefulness.complaint


@given(st.lists(st.tuples(st.integers(0, 10**9), st.integers(0, 10**14)), max_size=20))
def test_the_clock_of_a_process_counts_the_sleep_of_the_computer(awake_and_asleep_ns):
    """What CLOCK_MONOTONIC leaves out is part of the time since boot."""
    since_boot_ns = 5 * 10**12
    clock = Clock(lambda: since_boot_ns)
    before_us = clock.now_us()
    for awake_ns, asleep_ns in awake_and_asleep_ns:
        since_boot_ns += awake_ns + asleep_ns
        now_us = clock.now_us()
        assert abs((now_us - before_us) - (awake_ns + asleep_ns) / 1000) <= 1
        before_us = now_us


def test_a_clock_reads_what_counts_sleep(monkeypatch):
    read = []
    monkeypatch.setattr(time, "clock_gettime_ns", lambda which: read.append(which) or 0)
    Clock().now_us()
    assert set(read) == {time.CLOCK_BOOTTIME}

"""Figures of merit of ticks, from ticks whose figures are known."""

import numpy as np
import pytest

from koopman_lab.bus.pacing import TickTimes, load_tick_times, pacing
from koopman_lab.errors import LogError

PERFECT = np.arange(2001) * 10_000


def test_perfect_ticks_have_one_period_and_none_missed():
    found = pacing(PERFECT, 100.0)
    assert (found.ticks, found.missed, found.missed_share) == (2001, 0, 0.0)
    assert found[3:7] == (10.0, 10.0, 10.0, 10.0)
    assert found.error_p99_ms == 0.0


def test_skipped_deadlines_are_known_from_the_length():
    found = pacing(np.delete(PERFECT, [500, 501, 900]), 100.0)
    assert found.missed == 3
    assert found.missed_share == pytest.approx(3 / 2001)
    assert found.period_max_ms == 30.0


def test_a_late_tick_lengthens_one_period_and_shortens_the_next():
    late = PERFECT.copy()
    late[1000] += 4_000
    found = pacing(late, 100.0)
    assert found.missed == 0
    assert found.period_max_ms == 14.0
    assert found.period_p50_ms == 10.0


def test_times_are_read_as_they_were_written(tmp_path):
    times = TickTimes()
    for now_us in PERFECT[:5].tolist():
        times.note(now_us)
    times.save(tmp_path / "ticks.npy")
    np.testing.assert_array_equal(load_tick_times(tmp_path / "ticks.npy"), PERFECT[:5])
    with pytest.raises(LogError, match="absent"):
        load_tick_times(tmp_path / "absent.npy")

"""Inputs in time: nothing lost, nothing twice."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from offboard.controller.input_history import MEMORY_S, InputHistory

TIMES = st.lists(st.integers(0, 4_000_000), max_size=10, unique=True).map(sorted)


@given(TIMES, st.integers(0, 4_000_000), st.integers(0, 1_000_000))
def test_the_pieces_add_up_to_the_time_and_to_the_integral(times, start_us, lasts_us):
    history, end_us = InputHistory(2), start_us + lasts_us
    inputs = [np.array([1.0 + k, -2.0 * k]) for k in range(len(times))]
    for from_us, u in zip(times, inputs, strict=True):
        history.add(from_us, u)
    pieces = list(history.between(start_us, end_us, 0.05))
    assert all(0.0 < duration <= 0.05 for duration, _ in pieces)
    assert sum(duration for duration, _ in pieces) == pytest.approx(lasts_us * 1e-6, abs=1e-9)
    acting = np.zeros(2)
    for from_us, until_us, u in zip(times, [*times, end_us][1:], inputs, strict=True):
        acting += u * max(0, min(until_us, end_us) - max(from_us, start_us)) * 1e-6
    summed = sum((duration * u for duration, u in pieces), np.zeros(2))
    np.testing.assert_allclose(summed, acting, atol=1e-9)


def test_an_earlier_time_takes_the_place_of_what_was_to_come_later():
    history = InputHistory(2)
    history.add(100, np.ones(2))
    history.add(90, np.full(2, 3.0))
    ((duration_s, u),) = history.between(95, 105, 1.0)
    assert (duration_s, u[0]) == (pytest.approx(1e-5), 3.0)


def test_what_is_long_past_is_forgotten():
    history = InputHistory(2)
    for k in range(1000):
        history.add(k * 50_000, np.array([k, 0.0]))
    assert sum(1 for _ in history.between(0, 10**12, 1e9)) <= MEMORY_S / 0.05 + 2

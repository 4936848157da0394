"""The time until a command acts."""

import pytest

from koopman_lab.config.load import load_config
from offboard.controller.delay import LoopDelay


def test_it_is_made_of_solve_radio_and_tick():
    delay = LoopDelay(load_config())
    assert delay.estimate_s() == pytest.approx(0.005)
    delay.set_round_trip(6_000)
    delay.add_step_duration(0.012)
    assert delay.estimate_s() == pytest.approx(0.005 + 0.003 + 0.012)
    assert delay.after_sending_s == pytest.approx(0.005 + 0.003)


def test_one_stall_moves_nothing():
    delay = LoopDelay(load_config())
    for _ in range(10):
        delay.add_step_duration(0.01)
    before = delay.estimate_s()
    delay.add_step_duration(3.0)
    assert delay.estimate_s() == before

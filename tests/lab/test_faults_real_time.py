"""The five worst faults over real UDP: processes killed without a word, radio, emergency stop."""

import pytest
from klab import MODEL, SMALL_AREA, alive, klab_ok, start_klab
from witness import standing_robot

from offboard.bench.faults.bounds import by_driver, by_estop, by_watchdog
from offboard.terminal.exit_codes import ExitCode

BUSY_S = 0.25
"""What other processes on the machine may hold a message up, on top of the bound."""
SHORT_PAUSE = ("--set", "controller.pause_limit_s=0.5")
PARK = ("--start", "-1.2", "0.2", "0", "--set", "controller.horizon=20", *SHORT_PAUSE)


@pytest.fixture
def witness(bus_url):
    with standing_robot(bus_url) as witness:
        yield witness
    assert not [name for name, pid in witness.pids.items() if alive(pid)]


@pytest.fixture
def start(witness, tmp_path):
    """Start a session and wait until it drives the robot fast; it ends with the test."""
    started = []

    def begin(*arguments):
        started.append(start_klab(*arguments, "--out", tmp_path / "run"))
        witness.wait_until_fast(started[-1])
        return started[-1]

    yield begin
    for process in started:
        process.kill()
        process.wait()
        process.stdout.close()


def test_the_controller_is_killed_while_parking(witness, start):
    session = start("park", "--model", MODEL, *PARK)
    struck_us = witness.kill("controller")
    code, said = witness.end_of(session)
    assert (code, said.count("klab: ")) == (ExitCode.LAB_FAILURE, 1)
    assert "controller died (signal SIGKILL)" in said
    assert witness.moved_for_s(struck_us) <= by_watchdog(witness.config) + BUSY_S


def test_the_sampler_is_killed_while_calibrating(witness, start):
    session = start("calibrate", "--segments", "1", *SMALL_AREA)
    struck_us = witness.kill("sampler")
    code, said = witness.end_of(session)
    assert (code, said.count("klab: ")) == (ExitCode.LAB_FAILURE, 1)
    assert "sampler died (signal SIGKILL)" in said
    assert witness.moved_for_s(struck_us) <= by_watchdog(witness.config) + BUSY_S


def test_the_onboard_loop_is_killed_while_calibrating(witness, start):
    """Nobody is left who could set the motors to zero but their drivers."""
    session = start("calibrate", "--segments", "1", *SMALL_AREA, *SHORT_PAUSE)
    struck_us = witness.kill("onboard")
    code, said = witness.end_of(session)
    assert (code, said.count("klab: ")) == (ExitCode.LAB_FAILURE, 1)
    assert "R1_ONBOARD_STATUS: silent" in said
    assert witness.moved_for_s(struck_us) <= by_driver(witness.config) + BUSY_S


def test_the_radio_is_cut_while_parking(witness, start):
    session = start("park", "--model", MODEL, *PARK)
    assert klab_ok("fault", "radio-cut", "--duration-s", "inf") == ""
    code, said = witness.end_of(session)
    assert code == 1
    assert "not parked (onboard loop silent)" in said
    assert witness.moved_for_s(witness.cut_us) <= by_watchdog(witness.config) + BUSY_S


def test_the_emergency_stop_while_calibrating(witness, start):
    session = start("calibrate", "--segments", "1", *SMALL_AREA)
    klab_ok("estop")
    confirmed_us = witness.listener.now_us()
    code, said = witness.end_of(session)
    assert (code, said.count("klab: ")) == (ExitCode.LAB_FAILURE, 1)
    assert "the robot is stopped (emergency stop)" in said
    assert "klab estop --release" in said
    assert witness.moved_for_s(confirmed_us) <= by_estop(witness.config) + BUSY_S

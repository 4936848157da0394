"""The motor loop as on a real robot, over real UDP: a driver speaks ENCODER, all of it is real."""

import numpy as np
import pytest
from klab import klab, start_klab

from koopman_lab.bus import channels
from koopman_lab.bus.realtime import Listener
from koopman_lab.config.load import load_config
from koopman_lab.config.simulation import Fault
from koopman_lab.emulation.faults import KINDS, fault_message
from koopman_lab.units import US_PER_S
from offboard.terminal.exit_codes import ExitCode

MESSAGES = 1000
TICK_S = 0.01
MOST_TICKS = 6000
WITHIN_US = 5_000
SAID = "R1 (kinematic), preset real: nothing is simulated"


class Driver:
    """Speaks ENCODER of a robot that stands, a hundred times a second, and hears the board."""

    def __init__(self, bus_url):
        self.listener = Listener(load_config(preset="real", overrides=[f"bus.url={bus_url}"]))
        self.commands, self.statuses, self._said_us = [], [], 0
        self.listener.subscribe(channels.MOTOR_CMD, self._on_command)
        self.listener.subscribe(channels.ONBOARD_STATUS, self.statuses.append)

    def _on_command(self, message):
        self.commands.append((message.sequence, self.listener.now_us() - message.utime))

    def run_until(self, condition):
        for _ in range(MOST_TICKS):
            if condition():
                return
            now_us = self.listener.now_us()
            if now_us - self._said_us >= TICK_S * US_PER_S:
                self._said_us = now_us
                message = channels.ENCODER.type()
                message.utime, message.battery_v = now_us, 7.4
                self.listener.publish(channels.ENCODER, message)
            self.listener.spin(TICK_S)
        pytest.fail("did not happen in time")


@pytest.fixture
def board(bus_url):
    """Start the motor loop by hand, as on a robot; yield its process and its driver."""
    process, driver = start_klab("run", "onboard", "--url", bus_url), Driver(bus_url)
    driver.run_until(lambda: driver.statuses)
    yield process, driver
    process.terminate()
    process.wait()
    process.stdout.close()


def test_a_thousand_motor_commands_are_of_now_and_none_is_lost(board):
    process, driver = board
    driver.commands.clear()
    driver.run_until(lambda: len(driver.commands) >= MESSAGES)
    numbers, ages_us = np.array(driver.commands[:MESSAGES]).T
    assert np.array_equal(np.diff(numbers), np.ones(MESSAGES - 1))
    # How late a busy machine hands them over is its own affair; a wrong clock shifts them all.
    assert np.median(ages_us) <= WITHIN_US
    assert ages_us.min() >= -WITHIN_US
    process.terminate()
    assert process.stdout.read().splitlines() == [SAID]


def test_no_fault_is_obeyed_and_klab_fault_is_refused(board, bus_url):
    _, driver = board
    done = klab("fault", "radio-cut", "--url", bus_url)
    assert done.returncode == ExitCode.LAB_FAILURE
    assert done.stderr.count("klab: ") == 1
    assert "R1_PLANT_TRUTH is silent: only the simulated robot has faults" in done.stderr
    for kind in KINDS:
        message = fault_message(Fault(kind=kind), driver.listener.now_us())
        driver.listener.publish(channels.FAULT, message)
    while driver.listener.spin(0.0):  # what waited meanwhile
        pass
    driver.commands.clear()
    driver.statuses.clear()
    driver.run_until(lambda: len(driver.commands) >= 100 and len(driver.statuses) >= 5)
    numbers, ages_us = np.array(driver.commands).T
    assert np.array_equal(np.diff(numbers), np.ones(len(numbers) - 1))
    assert np.median(ages_us) <= WITHIN_US
    assert driver.statuses[-1].state == driver.statuses[-1].REST

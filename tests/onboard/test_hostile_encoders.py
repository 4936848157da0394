"""Encoders stamped by a clock that is wrong: the board goes on to speak, and stands."""

import pytest
from hostile.times import HOSTILE
from tests_support import Script

import lcmtypes
from koopman_lab.bus import channels
from koopman_lab.bus.lockstep import Lockstep
from koopman_lab.bus.motor_loop_faults import Fault
from koopman_lab.config.load import load_config
from onboard.motor_loop.loop import State
from onboard.motor_loop.node import OnboardNode

START_US = 1_700_000_000_000_000
FAR = {what: stamp for what, stamp in HOSTILE.items() if "just inside" not in what}


class Driver:
    """Motors that turn as fast as their counters say, 30 counts a reading."""

    name = "plant"

    def __init__(self):
        self.stamp_of = lambda now: now
        self.count = 0
        self.duties = []
        self.wheels = []

    def attach(self, port):
        self.port = port
        port.subscribe(channels.MOTOR_CMD, self.duties.append)
        port.subscribe(channels.WHEEL_STATE, self.wheels.append)
        port.every(100.0, self.speak)

    def close(self):
        """Nothing is held."""

    def speak(self, now_us):
        message = lcmtypes.encoder_t()
        message.utime = max(-(2**63), min(2**63 - 1, self.stamp_of(now_us)))
        message.left_count = message.right_count = self.count
        message.battery_v = 7.4
        self.count += 30
        self.port.publish(channels.ENCODER, message)


@pytest.mark.parametrize("what", FAR)
def test_the_board_hears_none_of_them_and_says_that_the_encoders_are_silent(what):
    config = load_config(robot="kinematic")
    lab, driver, onboard = Lockstep(config, START_US), Driver(), OnboardNode(config)
    driver.stamp_of = FAR[what]
    for node in (driver, onboard, Script(config, (0.2, 0.0))):
        lab.add(node)
    lab.run(2.0)
    assert onboard.loop.fault is Fault.ENCODERS_SILENT
    assert onboard.loop.state is State.FAULT
    assert driver.wheels == []
    assert (driver.duties[-1].left_duty, driver.duties[-1].right_duty) == (0.0, 0.0)
    # Once the clock is right the fault heals by itself.
    driver.stamp_of = lambda now: now
    lab.run(1.0)
    assert onboard.loop.fault is not Fault.ENCODERS_SILENT
    assert abs(driver.wheels[-1].utime - lab.now_us) < 100_000


def test_the_last_times_that_64_bits_hold_end_no_program():
    """In the desk's time, which is ahead of the board's, they would be beyond."""
    config = load_config(robot="kinematic")
    lab, driver, onboard = Lockstep(config, START_US), Driver(), OnboardNode(config)
    lab.add(driver)
    lab.add(onboard)
    lab.run(0.1)
    ahead_us, now_us = 30_000_000, lab.now_us
    pong = lcmtypes.time_pong_t()
    pong.ping_utime, pong.received_utime, pong.utime = now_us, now_us + ahead_us, now_us + ahead_us
    lab.send(channels.TIME_PONG.name("R1"), pong.encode())
    lab.run(0.1)
    assert abs(driver.wheels[-1].utime - lab.now_us - ahead_us) < 100_000
    last_us = 2**63 - 10_000_000
    driver.stamp_of = lambda now: last_us + now - now_us
    lab.run(1.0)
    assert onboard.loop.fault in (Fault.NO_FAULT, Fault.ENCODERS_SILENT)
    assert abs(driver.wheels[-1].utime - now_us - ahead_us) < 200_000

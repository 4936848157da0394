"""A kill switch stops and releases the robot whatever its clock says; a log never does."""

import pytest
from older_messages import encode
from tests_support import Script, lab_of

import lcmtypes
from koopman_lab.bus import channels
from koopman_lab.config.load import load_config
from koopman_lab.eventlog.older_layouts import OLDER_LAYOUTS
from koopman_lab.units import US_PER_S
from offboard.desk.orders import TRIES, WAIT_S, stop_order
from onboard.motor_loop.loop import State
from onboard.motor_loop.node import OnboardNode
from onboard.plant.node import PlantNode

START_US = 1_800_000_000 * US_PER_S
CLOCKS_S = [-3600.0, -10.0, 0.0, 10.0, 3600.0]
OLDER_STOP = next(of for of in OLDER_LAYOUTS if of.message_type is lcmtypes.estop_t)


class Switch:
    """A node that a person stops and releases the robot with, and whose clock is off."""

    name = "switch"

    def __init__(self, ahead_s):
        self.sent = []
        self.status = None
        self._ahead_us = round(ahead_s * US_PER_S)

    def attach(self, port):
        self._port = port
        port.subscribe(channels.ONBOARD_STATUS, lambda status: setattr(self, "status", status))

    def close(self):
        pass

    def now_us(self):
        return self._port.now_us() + self._ahead_us

    def publish(self, channel, message):
        self._port.publish(channel, message)
        self.sent.append(message.encode())


class Lab:
    """A robot that is being driven, and a switch."""

    def __init__(self, ahead_s=0.0, preset="lab"):
        config = load_config(preset=preset)
        self.switch, self.onboard = Switch(ahead_s), OnboardNode(config)
        nodes = PlantNode(config), self.onboard, Script(config, (0.3, 0.0)), self.switch
        self.lab = lab_of(config, *nodes, start_us=START_US)
        self.run(1.0)

    def run(self, seconds):
        self.lab.run(seconds)

    @property
    def state(self):
        return self.onboard.loop.state

    def order(self, *, release):
        """Order as `klab estop` does; return whether the robot says that it obeys."""
        order = stop_order(lambda: self.switch.status, release=release)
        for _ in range(TRIES + 1):
            obeyed = order.step(self.switch)
            if obeyed is not None:
                return obeyed
            self.run(WAIT_S)
        return None

    def say(self, wire):
        self.lab.send(channels.ESTOP.name("R1"), wire)
        self.run(0.1)


@pytest.mark.parametrize("preset", ["lab", "harsh"])
@pytest.mark.parametrize("ahead_s", CLOCKS_S)
def test_it_stops_and_releases_whatever_its_clock_says(ahead_s, preset):
    lab = Lab(ahead_s, preset)
    assert lab.state is State.DRIVING
    for _ in range(3):
        assert lab.order(release=False)
        assert lab.state is State.ESTOP
        lab.run(0.5)
        assert lab.onboard.loop.stop_latch.number == lab.switch.status.stop_number != 0
        assert lab.order(release=True)
        assert lab.state is State.DRIVING, "whoever commands takes it again"
        lab.run(0.3)
        assert lab.switch.status.stop_number == 0


@pytest.mark.parametrize("ahead_s", CLOCKS_S)
def test_what_it_said_once_never_releases_a_later_stop(ahead_s):
    """As a log that is played again does, with the numbers and the times that it holds."""
    lab = Lab(ahead_s)
    lab.order(release=False)
    lab.run(0.5)
    lab.order(release=True)
    log = list(lab.switch.sent)
    lab.run(0.5)
    lab.order(release=False)
    lab.run(0.5)
    refused = lab.onboard.loop.stop_latch.refused_releases
    releases = [wire for wire in log if not lcmtypes.estop_t.decode(wire).engaged]
    for wire in releases:
        lab.say(wire)
        assert lab.state is State.ESTOP
    assert lab.onboard.loop.stop_latch.refused_releases == refused + len(releases)
    lab.run(0.1)
    assert lab.switch.status.refused_release == refused + len(releases)
    for wire in log:
        lab.say(wire)
        assert lab.state is State.ESTOP
    assert lab.order(release=True)


def test_one_that_knows_no_numbers_releases_if_its_clock_is_right():
    lab = Lab()
    message = lcmtypes.estop_t()
    message.utime, message.engaged = lab.lab.now_us, True
    lab.say(message.encode())
    assert lab.state is State.ESTOP
    message.engaged = False
    message.utime -= US_PER_S
    lab.say(message.encode())
    assert lab.state is State.ESTOP
    message.utime = lab.lab.now_us
    lab.say(message.encode())
    assert lab.state is State.DRIVING


def test_one_of_an_older_version_still_stops_the_robot():
    lab = Lab()
    old = {"utime": lab.lab.now_us, "sequence": 0, "engaged": True}
    lab.say(encode(OLDER_STOP, old))
    assert lab.state is State.ESTOP
    lab.say(encode(OLDER_STOP, old | {"utime": lab.lab.now_us, "engaged": False}))
    assert lab.state is State.DRIVING

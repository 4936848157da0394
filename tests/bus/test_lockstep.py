import pytest
from tests_support import lab_of

import lcmtypes
from koopman_lab.bus import channels
from koopman_lab.bus.lockstep import Lockstep
from koopman_lab.config.load import load_config

CONFIG = load_config(preset="ideal")


class Talker:
    name = "plant"

    def attach(self, port):
        self.port = port
        port.every(100.0, self.tick)

    def tick(self, tick_us):
        message = lcmtypes.encoder_t()
        message.utime = tick_us
        self.port.publish(channels.ENCODER, message)

    def close(self):
        pass


class Hearer:
    name = "onboard"

    def __init__(self):
        self.heard = []
        self.before_tick = []

    def attach(self, port):
        self.port = port
        port.subscribe(channels.ENCODER, lambda m: self.heard.append((port.now_us(), m.utime)))
        port.every(100.0, lambda _: self.before_tick.append(len(self.heard)))

    def close(self):
        pass


def run(seconds):
    lockstep, hearer = Lockstep(CONFIG), Hearer()
    lockstep.add(Talker())
    lockstep.add(hearer)
    lockstep.run(seconds)
    return hearer


def test_messages_arrive_before_the_timers_of_the_same_instant():
    assert run(0.05).before_tick == [1, 2, 3, 4, 5, 6]


def test_it_stops_when_a_node_has_finished_and_hands_out_what_was_sent():
    lockstep, hearer = Lockstep(CONFIG), Hearer()
    talker = Talker()
    lockstep.add(talker)
    lockstep.add(hearer)
    tick = talker.tick

    def last(tick_us):
        tick(tick_us)
        if tick_us == 50_000:
            talker.port.finish()

    talker.port.timers[0].tick = last
    assert lockstep.run(1.0)
    assert hearer.heard[-1] == (50_000, 50_000)


def test_until_and_injected_messages():
    lockstep, hearer = Lockstep(CONFIG), Hearer()
    lockstep.add(hearer)
    lockstep.publish(channels.ENCODER, lcmtypes.encoder_t())
    assert lockstep.run(10.0, until=lambda: lockstep.now_us >= 3_000_000)
    assert len(hearer.heard) == 1
    assert lockstep.now_us == pytest.approx(3_000_000, abs=20_000)


class Aboard:
    """Speaks by wire and by radio."""

    name = "onboard"

    def attach(self, port):
        self.port = port
        port.every(100.0, self.tick)

    def tick(self, _):
        for channel in (channels.MOTOR_CMD, channels.ONBOARD_STATUS):
            message = channel.type()
            message.utime = self.port.now_us()
            self.port.publish(channel, message)

    def close(self):
        pass


class Listener:
    name = "logger"

    def __init__(self):
        self.heard = []

    def attach(self, port):
        self.port = port
        for channel in (channels.MOTOR_CMD, channels.ONBOARD_STATUS):
            port.subscribe_raw(channel, lambda *heard: self.heard.append(heard))

    def close(self):
        pass


def utime(name, data, _):
    return channels.split_name(name)[1].type.decode(data).utime


def listen(config, joined_s):
    lockstep, listener = lab_of(config, Aboard()), Listener()
    lockstep.run(joined_s)
    lockstep.add(listener)
    lockstep.run(1.0 - joined_s)
    return listener


def test_who_joins_later_hears_from_then_on_what_others_would_have_heard():
    bad = [
        "simulation.radio.from_robot.loss=0.3",
        "simulation.clock.offset_s=0",
        "simulation.clock.drift_ppm=0",
    ]
    config = load_config(preset="lab", overrides=bad)
    first, late = (listen(config, joined_s) for joined_s in (0.0, 0.195))
    assert late.heard == [message for message in first.heard if utime(*message) > 195_000]
    assert 0 < late.port.lost_messages()["R1_ONBOARD_STATUS"] < 40


def test_numbers_run_on_while_nobody_listens_and_a_later_listener_hears_the_next():
    lockstep, hearer = Lockstep(CONFIG), Hearer()
    lockstep.add(Talker())
    lockstep.run(0.095)
    lockstep.add(hearer)
    lockstep.run(0.05)
    assert [utime for _, utime in hearer.heard] == [100_000, 110_000, 120_000, 130_000, 140_000]
    assert hearer.port.lost_messages()["R1_ENCODER"] == 0
    assert hearer.port.subscriptions["R1_ENCODER"].counter.update(15, 150_000) == 0

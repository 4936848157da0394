import pytest
from hypothesis import given
from hypothesis import strategies as st

import lcmtypes
from koopman_lab.bus import channels
from koopman_lab.bus.port import BasePort, Timer
from koopman_lab.config.load import load_config
from koopman_lab.errors import BusError

CONFIG = load_config()


class Loop(BasePort):
    """A port that hears itself."""

    virtual = True

    def __init__(self):
        super().__init__("plant", CONFIG, process=0)
        self.sent = []

    def bus_us(self):
        return 0

    def send(self, name, data):
        self.sent.append((name, data))

    def deliver_at(self, at_us, take, data):
        take(data, at_us)


def test_late_ticks_are_skipped_and_counted_never_caught_up():
    ran = []
    timer = Timer(100.0, ran.append)
    for now in (0, 10_000, 20_100, 57_000, 60_000, 70_000):
        if timer.deadline_us <= now:
            timer.fire(now)
    assert ran == [0, 10_000, 20_000, 50_000, 60_000, 70_000]
    assert (timer.ticks_run, timer.missed) == (6, 2)


@given(st.integers(1, 1000), st.integers(0, 10**12), st.lists(st.booleans(), max_size=200))
def test_deadlines_do_not_drift(rate_hz, start_us, skips):
    timer = Timer(float(rate_hz), lambda _: None)
    timer.start(start_us)
    period_us = 1_000_000 // rate_hz
    for skip in skips:
        timer.fire(timer.deadline_us + skip * 7 * period_us)
    drift = (timer.deadline_us - start_us) * rate_hz - (timer.ticks_run + timer.missed) * 1_000_000
    assert abs(drift) <= rate_hz / 2 + 1e-3


def test_messages_are_numbered_per_channel():
    port = Loop()
    for _ in range(3):
        port.publish(channels.ENCODER, lcmtypes.encoder_t())
    port.publish(channels.MOCAP_POSE, lcmtypes.mocap_pose_t())
    numbers = [lcmtypes.encoder_t.decode(d).sequence for n, d in port.sent if n == "R1_ENCODER"]
    assert numbers == [0, 1, 2]
    assert lcmtypes.mocap_pose_t.decode(port.sent[-1][1]).sequence == 0


@given(st.binary(max_size=80))
def test_no_bytes_make_a_port_raise(data):
    port = Loop()
    seen = []
    port.subscribe(channels.ENCODER, seen.append)
    port.subscriptions["R1_ENCODER"].arrive(data, 0)
    assert port.undecodable == 1
    assert not seen


def test_names_split_back_into_robot_and_row():
    for channel in channels.CHANNELS:
        assert channels.split_name(channel.name("R12")) == ("R12", channel)
    for name in ("R1_NOTHING", "MOCAP_POSE", "_MOCAP_POSE", ""):
        with pytest.raises(BusError, match="MOCAP_POSE"):
            channels.split_name(name)

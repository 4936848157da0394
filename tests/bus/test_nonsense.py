"""Bytes that are no message of their channel: heard, written down, and nothing else."""

import json
import struct

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from koopman_lab.bus import channels
from koopman_lab.bus.channels import CHANNELS, HEARTBEATS, LOGGER_STATUS, MOCAP_POSE, ONBOARD_STATUS
from koopman_lab.bus.header import smallest_size
from koopman_lab.bus.lockstep import Lockstep
from koopman_lab.bus.sequence import LARGEST_GAP, SequenceCounter
from koopman_lab.config.load import load_config
from koopman_lab.data.decode import SessionLog
from koopman_lab.eventlog.eventlog import read_events
from offboard.logger.node import LoggerNode
from offboard.monitor.lab_view import LabView

CONFIG = load_config()
NOW_US = 10**15
INT64 = st.integers(-(2**63), 2**63 - 1)
FAR = 2**62


@st.composite
def nonsense(draw):
    """Return a channel, and bytes that are none of its messages, however like one they look."""
    channel = draw(st.sampled_from(CHANNELS))
    other = draw(st.sampled_from([c for c in CHANNELS if c.type is not channel.type]))
    stamps = struct.pack(">qq", draw(INT64), draw(INT64))
    end = draw(st.binary(max_size=120))
    cut = draw(st.integers(0, smallest_size(channel.type) - 1))
    whole = channel.type._get_packed_fingerprint() + stamps + end
    data = draw(
        st.sampled_from(
            (
                *(end, bytes(8) + stamps + end, whole[:cut]),
                other.type._get_packed_fingerprint() + stamps + end,
                bytes(16) + struct.pack(">q", FAR) + bytes(16),
            )
        )
    )
    return channel, data


MANY = st.lists(nonsense(), max_size=20)


def said(channel, sequence, utime=NOW_US):
    message = channel.type()
    message.utime, message.sequence = utime, sequence
    return channel.name("R1"), message.encode()


class Ear:
    """Listens to everything."""

    name = "ear"

    def __init__(self):
        self.heard = []

    def attach(self, port):
        for channel in CHANNELS:
            port.subscribe(channel, self.heard.append)

    def close(self):
        pass


@settings(max_examples=30)
@given(story=MANY)
def test_the_logger_writes_it_down_and_counts_no_loss(tmp_path_factory, story):
    path = tmp_path_factory.mktemp("log") / "session.lcm"
    lab = Lockstep(CONFIG)
    lab.add(LoggerNode(CONFIG, path))
    lab.add(ear := Ear())
    logged = [(c.name("R1"), data) for c, data in story if c.logged]
    for name, data in (said(MOCAP_POSE, 7), *logged, said(MOCAP_POSE, 8)):
        lab.send(name, data)
    lab.run(1.0)
    lab.close()
    events = [(event.channel, event.data) for event in read_events(path)]
    assert [event for event in events if event in logged] == logged
    log = SessionLog(path, salvage=True)
    assert {status.lost_messages for status in log.messages(LOGGER_STATUS)} == {0}
    assert log.messages(HEARTBEATS["logger"])[-1].undecodable_messages == len(logged)
    assert {summary.lost for summary in log.channels.values()} == {0}
    assert [m.sequence for m in ear.heard if type(m) is MOCAP_POSE.type] == [7, 8]


@settings(max_examples=60)
@given(story=MANY)
def test_the_viewer_shows_the_same_as_without_it(story):
    views = [LabView(CONFIG), LabView(CONFIG)]
    for view in views:
        for channel in (MOCAP_POSE, ONBOARD_STATUS):
            view.take(*said(channel, 7), NOW_US)
    for channel, data in story:
        for robot_name in ("R1", "R9"):
            views[0].take(channel.name(robot_name), data, NOW_US + 2_000_000)
    for view in views:
        view.take(*said(MOCAP_POSE, 8), NOW_US + 3_000_000)
    shown, expected = (view.snapshot(NOW_US + 3_100_000) for view in views)
    for flow in shown["R1"]["channels"]:
        flow["undecodable"] = 0
    assert json.dumps(shown) == json.dumps(expected)


@pytest.mark.parametrize("far", [FAR, 2**63 - 1, -FAR, -(2**63), 12 + 2 * LARGEST_GAP])
def test_a_number_out_of_all_reach_is_no_loss_and_hides_none(far):
    counter = SequenceCounter()
    for sequence in (10, 11, far, 12, 13, far + (1 if far < 0 else -1), far, 14, 16):
        counter.update(sequence, utime=sequence)
    assert counter.lost == 1


def test_a_log_says_of_such_a_number_what_was_said_live(tmp_path):
    path = tmp_path / "session.lcm"
    lab = Lockstep(CONFIG)
    lab.add(LoggerNode(CONFIG, path))
    for sequence in (10, 11, FAR, 12, -FAR, 13, 15):
        lab.send(*said(channels.ENCODER, sequence))
    lab.run(0.1)
    lost = lab._ports[0].lost_messages()["R1_ENCODER"]
    lab.close()
    assert lost == SessionLog(path).channels["R1_ENCODER"].lost == 1

"""A second program under a robot's name, on the page and in the table of channels."""

import re

import pytest
from speakers import encoded, speak

from koopman_lab.bus.channels import LOGGER_STATUS, MOCAP_POSE, ONBOARD_STATUS
from koopman_lab.config.load import load_config
from offboard.commands.topics import _table
from offboard.monitor.lab_view import LabView
from offboard.monitor.streams import Streams, identity_lines

CONFIG = load_config()
ONE, OTHER = speak(240, 9), speak(240, 7, first=9000, start_us=901)
LINE = re.compile(
    r"R1_MOCAP_POSE \((479|480) of 240 Hz\): 2 publishers; a second camera bridge uses the name "
    r"R1: stop it, or give it another --robot-name than R1"
)


def say(taker, *streams, channel=MOCAP_POSE, until_us=10_000_000):
    """Let a robot's channel be heard; return the time of the newest message."""
    newest_us = 0
    for message in sorted(message for stream in streams for message in stream):
        if message.arrived_us <= until_us:
            newest_us = message.arrived_us
            taker.take(channel.name("R1"), encoded(channel, message), newest_us)
    return newest_us


def test_a_banner_names_it_within_a_second_and_goes_when_it_goes():
    view = LabView(CONFIG)
    banners = view.snapshot(say(view, ONE, OTHER, until_us=1_000_000))["R1"]["banners"]
    assert any("R1_MOCAP_POSE" in line and "2 publishers" in line for line in banners)
    view = LabView(CONFIG)
    together_us = say(view, ONE, OTHER, until_us=6_500_000)
    (line,) = view.robots["R1"].identity_lines(together_us)
    assert LINE.fullmatch(line)
    assert line in view.snapshot(together_us)["R1"]["banners"]
    view = LabView(CONFIG)
    alone_us = say(view, ONE, OTHER)
    assert not view.robots["R1"].identity_lines(alone_us)


def flows(*streams, channel=MOCAP_POSE, later_us=0):
    heard = Streams()
    return heard.flows(say(heard, *streams, channel=channel) + later_us, CONFIG)


def test_the_table_has_a_column_only_where_something_is_wrong():
    both = _table(flows(ONE[:1650], OTHER))
    assert (both.columns[-1].header, list(both.columns[-1].cells)) == ("publishers", ["2"])
    still = _table(flows([m._replace(sequence=4) for m in ONE]))
    assert list(still.columns[-1].cells) == ["1, stands still"]
    assert _table(flows(ONE)).columns[-1].header == "age (s)"


@pytest.mark.parametrize(
    ("channel", "publishers"), [(MOCAP_POSE, 2), (ONBOARD_STATUS, 2), (LOGGER_STATUS, None)]
)
def test_two_loggers_may_speak_at_once_and_two_boards_may_not(channel, publishers):
    (flow,) = flows(ONE[:1650], OTHER, channel=channel)
    assert flow.publishers == publishers
    assert bool(identity_lines([flow])) == (publishers == 2)


def test_a_stream_that_fell_silent_is_doubted_no_more():
    still = [message._replace(sequence=4) for message in ONE]
    assert identity_lines(flows(still))
    assert not identity_lines(flows(still, later_us=1_100_000))

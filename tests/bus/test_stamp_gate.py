"""The gate of stamps: what is plausible, what is said of the rest, and that none is forgotten."""

import pytest
from hostile.times import HOSTILE
from hypothesis import given
from hypothesis import strategies as st

from koopman_lab.bus import channels
from koopman_lab.bus.channels import CHANNELS, HEARTBEATS
from koopman_lab.bus.stamp_gate import INLETS, SAID_US, StampGate, clock_text

NOW_US = 1_700_000_000_000_000
INT64 = st.integers(-(2**63), 2**63 - 1)
GATED = [channel for channel in CHANNELS if channel.suffix in INLETS]

ONLY_AGE = {
    "VELOCITY_CMD": "the board's arbiter holds it to motor_loop.command_lifetime_s",
    "ACCELERATION_CMD": "likewise",
    "GOAL": "the controller holds it to motor_loop.command_lifetime_s",
    "ESTOP": "compared with now: nobody stops in the future",
    "PLANT_RESET": "an order, within 5 s of now",
    "FAULT": "an order, within 5 s of now",
    "MOTOR_CMD": "tells one sender from another, nothing else",
    "TIME_PING": "answered as it is; the answer is the same whatever it says",
    "TIME_PONG": "both clocks' times by their round trip, at most 1 s, and below 2^61",
    "TIME_SYNC": "the round trip in it counts up to 1 s",
}
"""Channels with stamps that are judged where they are used."""
NEVER_READ = {
    *("SAMPLER_STATE", "REFERENCE_STATE", "MPC_STATE", "INTERLOCK", "SESSION_INFO", "PROCESS"),
    *("REPLAY_STATE", "REPLAY_CONTROL"),
    *(channel.suffix for channel in HEARTBEATS.builtin()),
}
"""Channels whose stamps only tell copies and replays from what is new."""


def test_every_channel_is_gated_judged_by_its_age_or_never_computed_with():
    suffixes = {channel.suffix for channel in CHANNELS}
    assert suffixes == set(INLETS) | set(ONLY_AGE) | NEVER_READ
    assert not set(INLETS) & (set(ONLY_AGE) | NEVER_READ)


@pytest.mark.parametrize("channel", GATED, ids=lambda channel: channel.suffix)
@given(stamped_us=INT64, now_us=st.integers(0, 2**52))
def test_what_lies_about_now_is_admitted_and_nothing_else(channel, stamped_us, now_us):
    gate, inlet = StampGate(channel), INLETS[channel.suffix]
    about_now = now_us - inlet.behind_us <= stamped_us <= now_us + inlet.ahead_us
    assert gate.admits(stamped_us, now_us) is about_now
    assert bool(gate.complaint(now_us)) is not about_now
    assert gate.refused == (not about_now)


@pytest.mark.parametrize("channel", GATED, ids=lambda channel: channel.suffix)
def test_the_ends_are_plausible(channel):
    gate, inlet = StampGate(channel), INLETS[channel.suffix]
    assert gate.admits(NOW_US + inlet.ahead_us, NOW_US)
    assert gate.admits(NOW_US - inlet.behind_us, NOW_US)
    assert not gate.admits(NOW_US + inlet.ahead_us + 1, NOW_US)
    assert not gate.admits(NOW_US - inlet.behind_us - 1, NOW_US)


@pytest.mark.parametrize("what", HOSTILE)
def test_a_wrong_clock_is_said_for_as_long_as_it_runs(what):
    gate = StampGate(channels.ONBOARD_STATUS)
    if gate.admits(HOSTILE[what](NOW_US), NOW_US):
        return
    for k in range(5):
        now_us = NOW_US + k * SAID_US
        gate.admits(HOSTILE[what](NOW_US) + (k if k % 2 else -k), now_us)
        assert "onboard clock" in gate.complaint(now_us)
    assert gate.complaint(now_us + SAID_US)
    assert gate.complaint(now_us + SAID_US + 1) == ""


def test_a_stamp_that_is_repeated_is_no_clock():
    gate = StampGate(channels.ONBOARD_STATUS)
    for k in range(20):
        gate.admits(NOW_US + 10**10, NOW_US + k * 100_000)
    assert gate.complaint(NOW_US + 20 * 100_000) == ""


@pytest.mark.parametrize(
    ("stamped_us", "said"),
    [
        (NOW_US + 3_600_000_000, "the camera clock is 3600 s ahead of this computer's clock"),
        (NOW_US - 86_400_000_000, "the camera clock is 86400 s behind this computer's clock"),
        (NOW_US // 1000, "the camera clock stamps in ms instead of us"),
        (NOW_US // 1_000_000, "the camera clock stamps in s instead of us"),
        (NOW_US * 1000, "the camera clock stamps in ns instead of us"),
        (0, "the camera clock is 1700000000 s behind this computer's clock"),
    ],
)
def test_the_clock_is_named_with_its_unit_or_by_how_much(stamped_us, said):
    assert clock_text("camera clock", stamped_us, NOW_US) == said

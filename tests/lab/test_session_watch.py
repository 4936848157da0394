"""A session gives up on a robot that it cannot drive."""

import pytest

import lcmtypes
from koopman_lab.bus.commanders import commander_number
from koopman_lab.config.load import load_config
from koopman_lab.errors import LabStateError
from offboard.lab.session_watch import (
    PATIENCE_S,
    START_LIMIT_S,
    RobotWatch,
    StartWatch,
)

STATUS = lcmtypes.onboard_status_t
OWN, OTHER = commander_number("sampler", 10), commander_number("controller", 4711)
END_US = round((PATIENCE_S + 1.0) * 1e6)


def watched(own, **fields):
    """See one status again and again for longer than the patience."""
    watch, status = RobotWatch(load_config(), own), STATUS()
    for name, value in fields.items():
        setattr(status, name, value)
    for now_us in range(0, END_US, 100_000):
        watch.see(status, now_us)
        watch.check(now_us)


@pytest.mark.parametrize(
    ("fields", "said"),
    [
        ({"commander": OTHER}, r"held by controller \(process 4711\).*--robot-name"),
        ({"state": STATUS.ESTOP}, "emergency stop.*klab estop --release"),
        ({"state": STATUS.FAULT, "fault": STATUS.BATTERY_LOW}, "battery low.*--release"),
    ],
)
def test_what_holds_the_robot_is_said_with_the_remedy(fields, said):
    with pytest.raises(LabStateError, match=f"R1_ONBOARD_STATUS: .*{said}"):
        watched(OWN, **fields)


@pytest.mark.parametrize(
    ("commander", "fields"),
    [(OWN, {"commander": OWN}), (OWN, {}), (None, {"commander": OTHER})],
)
def test_a_robot_that_can_be_driven_is_left_alone(commander, fields):
    watched(commander, **fields)


def test_a_silent_robot_is_not_waited_for():
    watch = RobotWatch(load_config(overrides=["controller.pause_limit_s=2"]))
    watch.check(0)
    watch.check(4_000_000)
    with pytest.raises(LabStateError, match="silent for 5 s"):
        watch.check(6_000_000)


@pytest.mark.parametrize("opened_us", [0, 10**15])
def test_a_node_that_does_not_begin_is_waited_for_from_the_first_look_on(opened_us):
    limit_us = round(START_LIMIT_S * 1e6)
    start = StartWatch("sampler", "R1_MOCAP_POSE")
    start.check(opened_us)
    start.check(opened_us + limit_us)
    with pytest.raises(
        LabStateError, match=r"sampler: has not begun within 30 s; .* R1_MOCAP_POSE"
    ):
        start.check(opened_us + limit_us + 1)
    start.begun = True
    start.check(opened_us + 2 * limit_us)


def test_who_says_what_it_waits_for_is_waited_for_no_longer_than_others():
    watch = StartWatch("controller", "cameras", limit_s=90.0)
    watch.check(0)
    watch.hear("R1_MOCAP_POSE: 2 publishers", 5_000_000)
    watch.check(5_000_000 + round(START_LIMIT_S * 1e6))
    with pytest.raises(LabStateError, match="it sees: R1_MOCAP_POSE: 2 publishers"):
        watch.check(5_100_000 + round(START_LIMIT_S * 1e6))
    watch.begun = True
    watch.check(80_000_000)

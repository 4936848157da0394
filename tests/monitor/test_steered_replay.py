"""A replay that somebody steers: what the page shows of it, by plain calls."""

import json
import math

import pytest
from monitor.test_state import YEAR_US, robot_of, seen, speak

from koopman_lab.bus.channels import ONBOARD_STATUS, REPLAY_CONTROL, REPLAY_STATE
from koopman_lab.config.load import load_config
from offboard.monitor.lab_view import LabView


def say(view, now_us, **fields):
    state = REPLAY_STATE.type()
    state.utime, state.speed, state.playing, state.end_s = now_us, 1.0, True, 9.0
    for name, value in fields.items():
        setattr(state, name, value)
    view.take("R1_REPLAY_STATE", state.encode(), now_us)


@pytest.fixture
def replay():
    return seen("park.lcm", later_us=YEAR_US)


def test_it_is_where_it_says_until_it_says_no_more(replay):
    view, now_us = replay
    assert robot_of(replay)["replay_progress"] is None
    say(view, now_us, position_s=2.5, start_s=1.0, speed=4.0, loop=True)
    assert robot_of(replay)["replay_progress"] == {
        **{"position_s": 2.5, "start_s": 1.0, "end_s": 9.0, "speed": 4.0},
        **{"playing": True, "loop": True},
    }
    assert robot_of(replay, later_s=2.0)["replay_progress"] is None


def test_a_paused_one_shows_the_moment_at_which_it_is_for_as_long_as_it_is_paused(replay):
    view, now_us = replay
    before = robot_of(replay)
    for later_s in (1.0, 30.0, 600.0):
        say(view, now_us + round(later_s * 1e6), playing=False)
        robot = robot_of(replay, later_s)
        for key in ("line", "pose", "goal", "speeds", "battery_v", "banners"):
            assert robot[key] == before[key]
        assert robot["replay"]
        assert not robot["steerable"]
    # Nobody says any more that it is paused: it is over.
    assert robot_of(replay, 630.0)["line"].startswith("replay: over for")


def test_nothing_that_lives_is_ever_shown_as_paused():
    """Who says so of a live robot, by mistake or on purpose, hides nothing of it."""
    view, now_us = seen("park.lcm", until_us=3_000_000)
    for later_s in (0.5, 1.5, 3.5):
        say(view, now_us + round(later_s * 1e6), playing=False)
    robot = view.snapshot(now_us + 3_500_000)["R1"]
    assert robot["pose"] is None
    assert robot["line"] == "nothing heard for 4 s"


def test_where_it_goes_on_elsewhere_no_message_counts_as_lost(replay):
    view, now_us = replay

    def lost():
        now = now_us + 5_000_000
        return sum(flow["lost"] or 0 for flow in view.snapshot(now)["R1"]["channels"])

    before = lost()
    say(view, now_us, seeks=1)
    status = ONBOARD_STATUS.type()
    status.utime, status.sequence = 1, 10**6
    view.take("R1_ONBOARD_STATUS", status.encode(), now_us + 1)
    assert lost() <= before
    status.sequence += 3
    view.take("R1_ONBOARD_STATUS", status.encode(), now_us + 2)
    assert sum(f["lost"] or 0 for f in view.snapshot(now_us + 9_000_000)["R1"]["channels"]) == 2


def test_a_log_of_which_nothing_was_sent_yet_can_be_begun():
    view = LabView(load_config())
    say(view, 1_000, playing=False)
    robot = view.snapshot(2_000)["R1"]
    assert robot["line"] == "replay: nothing was sent yet"
    assert (robot["replay"], robot["steerable"], robot["pose"]) == (True, False, None)
    assert robot["replay_progress"]["end_s"] == 9.0
    # What is asked of a replay is no robot: its name may be a slip.
    view.take("R7_REPLAY_CONTROL", REPLAY_CONTROL.type().encode(), 1_000)
    assert "R7" not in view.robots


def test_no_nonsense_breaks_the_page():
    view = LabView(load_config())
    speak(view, "R1", 2_000)
    for value in (math.nan, math.inf, -math.inf, 1e308):
        say(view, 3_000, position_s=value, speed=value)
        json.dumps(view.snapshot(4_000), allow_nan=False)


def test_nobody_makes_a_live_robot_forget_what_its_streams_miss():
    """Whoever says that a log has jumped, over and over, beside a robot that speaks."""
    view, now_us = seen("park.lcm", until_us=3_000_000)
    streams = view.robots["R1"]._streams
    before = {name: stream._publishers for name, stream in streams.items()}
    for seeks in range(1, 5):
        say(view, now_us, seeks=seeks)
    assert {name: stream._publishers for name, stream in streams.items()} == before
    assert robot_of((view, now_us))["replay_progress"] is None

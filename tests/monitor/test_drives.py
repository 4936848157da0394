"""How drives begin and end, and what a robot's state is in words, by plain calls."""

import math

import pytest

import lcmtypes
from offboard.monitor.drives import CALIBRATION, PARKING, SILENT_S, Drives
from offboard.monitor.robot_state import age_text, robot_state
from offboard.monitor.state_in_words import TONES

S = 1_000_000
KIND = lcmtypes.onboard_status_t


def step(state, x1=0.003, x2=0.004, theta=0.01):
    message = lcmtypes.mpc_state_t()
    message.state = state
    message.state_in_goal_frame = [x1, x2, theta] + [0.0] * (message.MOST_STATES - 3)
    return message


def sampler(phase, done=0):
    message = lcmtypes.sampler_state_t()
    message.phase, message.segments_done, message.segments_total = phase, done, 6
    return message


def status(state=KIND.REST, commander=0, fault=0):
    message = KIND()
    message.state, message.commander, message.fault = state, commander, fault
    return message


def shown(now_us, drive=None, **changes):
    facts = {"gone": False, "replay": False, "status": status(), "waiting": ""} | changes
    return robot_state(now_us, drive=drive, **facts)


def test_a_park_begins_with_its_first_step_and_ends_in_words():
    drives, kind = Drives(), lcmtypes.mpc_state_t
    drives.take_mpc(step(kind.WAIT), 0)
    assert drives.newest(0) is None
    for k in range(70):
        drives.take_mpc(step(kind.DRIVING), k * S // 10 + S)
    assert shown(7 * S, drives.newest(7 * S)).word == "parking"
    for k in (80, 90):  # said again and again
        drives.take_mpc(step(kind.PARKED), k * S // 10)
    drive = drives.newest(100 * S)
    assert (drive.activity, drive.began_us, drive.heard_us) == (PARKING, S, 8 * S)
    assert shown(20 * S, drive) == (
        "parked",
        "good",
        "5.0 mm and 0.6° from the goal, 12 s ago",
    )


@pytest.mark.parametrize(
    ("state", "reason", "words"),
    [
        (lcmtypes.mpc_state_t.TIME_LIMIT, "", "gave up at the time limit, 0.50 m"),
        (lcmtypes.mpc_state_t.FAILED, "outside the floor", "outside the floor, 0.50 m"),
        (lcmtypes.mpc_state_t.FAILED, "", "the controller gave up, 0.50 m"),
    ],
)
def test_a_park_that_fails_says_why(state, reason, words):
    drives = Drives()
    drives.take_mpc(step(lcmtypes.mpc_state_t.DRIVING, 0.3, 0.4), 0)
    drives.take_mpc(step(state), S, reason)
    seen = shown(2 * S, drives.newest(2 * S))
    assert (seen.word, seen.tone) == ("not parked", "warn")
    assert seen.detail.startswith(words)


def test_whoever_falls_silent_has_not_parked():
    drives = Drives()
    drives.take_mpc(step(lcmtypes.mpc_state_t.DRIVING), 0)
    assert drives.newest(round(SILENT_S * S)).end is None
    seen = shown(9 * S, drives.newest(9 * S))
    assert seen == ("not parked", "warn", "the controller fell silent before the end, 9 s ago")
    # Who drives on after that begins a drive of its own.
    drives.take_mpc(step(lcmtypes.mpc_state_t.DRIVING), 9 * S)
    assert drives.newest(9 * S).began_us == 9 * S


def test_one_who_watches_only_the_end_has_seen_no_drive():
    drives = Drives()
    drives.take_mpc(step(lcmtypes.mpc_state_t.PARKED), 0)
    drives.take_sampler(sampler(lcmtypes.sampler_state_t.DONE, 6), 0)
    assert drives.newest(0) is None


def test_a_calibration_takes_the_place_of_a_park():
    drives, phases = Drives(), lcmtypes.sampler_state_t
    drives.take_mpc(step(lcmtypes.mpc_state_t.DRIVING), 0)
    drives.take_mpc(step(lcmtypes.mpc_state_t.PARKED), S)
    drives.take_sampler(sampler(phases.WAIT), 2 * S)
    assert drives.newest(2 * S).activity == PARKING
    drives.take_sampler(sampler(phases.BASIS), 3 * S)
    assert drives.newest(3 * S)[:2] == (CALIBRATION, 3 * S)
    assert shown(3 * S, drives.newest(3 * S)) == ("calibrating", "active", "")
    drives.take_sampler(sampler(phases.DONE, 6), 4 * S)
    assert shown(4 * S, drives.newest(4 * S)).detail == "6 of 6 segments, 0 s ago"


@pytest.mark.parametrize(
    ("done", "word", "tone"),
    [(6, "calibrated", "good"), (5, "not calibrated", "warn"), (0, "not calibrated", "warn")],
)
def test_a_sampler_that_gave_up_is_done_too_and_has_not_calibrated(done, word, tone):
    drives, phases = Drives(), lcmtypes.sampler_state_t
    drives.take_sampler(sampler(phases.BASIS), 0)
    drives.take_sampler(sampler(phases.DONE, done), S)
    seen = shown(S, drives.newest(S))
    assert (seen.word, seen.tone) == (word, tone)
    assert seen.detail.startswith(f"{done} of 6 segments")


@pytest.mark.parametrize(
    ("done", "word", "tone"),
    [(4, "runs recorded", "good"), (3, "not all runs", "warn"), (0, "not all runs", "warn")],
)
def test_reference_runs_that_were_given_up_are_not_all_runs(done, word, tone):
    drives, state = Drives(), lcmtypes.reference_state_t()
    state.phase, state.runs_total = state.RUN, 4
    drives.take_reference(state, 0)
    state.phase, state.runs_done = state.DONE, done
    drives.take_reference(state, S)
    seen = shown(S, drives.newest(S))
    assert (seen.word, seen.tone) == (word, tone)


@pytest.mark.parametrize(
    ("facts", "word", "tone"),
    [
        ({}, "idle", "idle"),
        ({"gone": True}, "gone", "gone"),
        ({"gone": True, "replay": True}, "replay over", "gone"),
        ({"replay": True, "status": None}, "replay", "replay"),
        ({"status": None}, "motor loop silent", "bad"),
        ({"status": status(KIND.ESTOP)}, "stopped", "bad"),
        ({"status": status(KIND.FAULT, fault=KIND.BATTERY_LOW)}, "fault", "bad"),
        ({"status": status(KIND.WATCHDOG)}, "stopped by the watchdog", "warn"),
        ({"status": status(commander=2)}, "driven", "active"),
        ({"status": status(commander=2), "waiting": "no frame"}, "waiting", "warn"),
    ],
)
def test_a_robot_without_a_drive_is_in_words_too(facts, word, tone):
    seen = shown(0, **facts)
    assert (seen.word, seen.tone) == (word, tone)
    assert tone in TONES


def test_a_stop_is_said_before_what_it_stopped():
    drives = Drives()
    drives.take_mpc(step(lcmtypes.mpc_state_t.DRIVING), 0)
    drive = drives.newest(0)
    assert shown(0, drive, status=status(KIND.ESTOP)).word == "stopped"
    assert shown(0, drive, waiting="no frame")[:2] == ("paused", "warn")
    assert shown(0, drive, replay=True) == ("replay", "replay", "parking")


def test_nonsense_of_the_bus_is_no_distance():
    drives = Drives()
    drives.take_mpc(step(lcmtypes.mpc_state_t.DRIVING, math.nan), 0)
    drives.take_mpc(step(lcmtypes.mpc_state_t.PARKED, math.inf), 1)
    assert shown(1, drives.newest(1)).detail == "0 s ago"


@pytest.mark.parametrize(
    ("age_s", "text"), [(-1, "0 s"), (119, "119 s"), (150, "2 min"), (9000, "2 h"), (86400, "24 h")]
)
def test_a_time_is_said_as_exactly_as_a_person_wants_it(age_s, text):
    assert age_text(age_s) == text

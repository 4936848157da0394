"""The page's state, by plain calls: messages in, snapshot out."""

import json
import math
from pathlib import Path

import pytest

import lcmtypes
from koopman_lab.bus import channels
from koopman_lab.config.load import load_config
from koopman_lab.data.decode import SessionLog
from koopman_lab.replay.rotated_log import read_rotated_log
from offboard.monitor.json_values import number
from offboard.monitor.lab_view import LabView
from offboard.monitor.robot_view import ROW_S

REFERENCE = Path(__file__).parents[1] / "data" / "reference"
YEAR_US = 365 * 86_400_000_000


def seen(log: str, later_us: int = 0, until_us: int = YEAR_US) -> tuple[LabView, int]:
    """Show a log to a view as if it arrived so much later; return the view and the last time."""
    view, now_us = LabView(load_config()), 0
    for event in read_rotated_log(REFERENCE / log):
        if event.timestamp_us > until_us:
            break
        now_us = event.timestamp_us + later_us
        view.take(event.channel, event.data, now_us)
    return view, now_us


def recorded(log, channel):
    return [
        channel.type.decode(event.data)
        for event in read_rotated_log(REFERENCE / log)
        if event.channel == channel.name("R1")
    ]


@pytest.fixture(scope="module")
def park():
    return seen("park.lcm")


@pytest.fixture(scope="module")
def calibration():
    return seen("calibration.lcm")


def speak(view, name, now_us, channel=channels.ONBOARD_STATUS):
    message = channel.type()
    message.utime = now_us
    view.take(channel.name(name), message.encode(), now_us)


def robot_of(seen_log, later_s=0.0):
    view, now_us = seen_log
    return view.snapshot(now_us + round(later_s * 1e6))["R1"]


def test_a_park_is_seen_with_robot_goal_and_prediction():
    robot = robot_of(seen("park.lcm", until_us=3_000_000))
    assert robot["goal"] == pytest.approx([0.1, 0.0, math.radians(20.0)], rel=1e-5)
    assert robot["tracked"]
    assert len(robot["horizon"]) == 61
    assert robot["line"].startswith("parking: driving, 0.")
    assert robot["steerable"]
    assert not robot["replay"]
    assert robot["banners"] == []
    assert robot["kind"] == "kinematic"
    assert robot["sets"]["X0"] == {"x1_m": [0.0, 1.5], "x2_m": [-0.75, 0.75]}
    assert {p["name"]: p["state"] for p in robot["processes"]} == dict.fromkeys(
        ("controller", "onboard", "plant", "logger"), "alive"
    )


def test_a_park_that_has_ended_says_how_and_the_axis_knows_from_when_to_when(park):
    view, now_us = park
    robot = view.snapshot(now_us)["R1"]
    assert (robot["state"]["word"], robot["state"]["tone"]) == ("parked", "good")
    assert "from the goal" in robot["state"]["detail"]
    drive = robot["drive"]
    driven = [m.utime for m in recorded("park.lcm", channels.MPC_STATE) if m.state == m.DRIVING]
    length_s = (driven[-1] - driven[0]) * 1e-6
    assert drive["activity"] == "parking"
    assert drive["ended_s"] - drive["began_s"] == pytest.approx(length_s, abs=0.2)
    assert robot_of(seen("park.lcm", until_us=3_000_000))["state"]["word"] == "parking"


def test_a_calibration_is_said_to_go_on_and_a_silent_robot_to_be_gone(calibration):
    word = robot_of(seen("calibration.lcm", until_us=5_000_000))["state"]["word"]
    assert word == "calibrating"
    assert robot_of(calibration, later_s=60.0)["state"]["word"] == "gone"


def test_the_rows_of_a_park_hold_what_the_plots_draw(park):
    view, _ = park
    news, marks = view.histories(())
    rows = news["R1"]["rows"]["items"]
    seconds = SessionLog(REFERENCE / "park.lcm").duration_s
    assert len(rows) == pytest.approx(seconds / ROW_S, rel=0.1)
    steps = [
        (number(state.value_function), number(state.solve_ms), number(state.state_in_goal_frame[1]))
        for state in recorded("park.lcm", channels.MPC_STATE)
        if state.state == state.DRIVING
    ]
    shown = [tuple(row[8:]) for row in rows if row[8] is not None]
    assert len(shown) >= 0.9 * len(steps) > 50
    assert set(shown) <= set(steps)
    # A page that has everything is sent nothing again.
    again, following = view.histories(marks)
    assert again["R1"]["rows"]["items"] == []
    assert following == marks


def test_channels_flow_at_the_rates_of_the_log(calibration):
    flows = {f["name"]: f for f in robot_of(calibration)["channels"]}
    assert flows["R1_MOCAP_POSE"]["rate_hz"] == pytest.approx(40.0, rel=0.02)
    assert flows["R1_WHEEL_STATE"]["rate_hz"] == pytest.approx(20.0, rel=0.02)
    assert flows["R1_SESSION_INFO"]["rate_hz"] == pytest.approx(1.0, rel=0.02)
    assert flows["R1_MOCAP_POSE"]["nominal_hz"] == 40.0
    assert {f["lost"] for f in flows.values() if f["nominal_hz"] is not None} == {0}


def test_a_calibration_shows_its_progress_and_the_segments_so_far(calibration):
    view, now_us = calibration
    robot = view.snapshot(now_us)["R1"]
    states = recorded("calibration.lcm", channels.SAMPLER_STATE)
    assert robot["sampler"]["done"] == states[-1].segments_done
    assert robot["sampler"]["samples"] == states[-1].samples
    news, _ = view.histories(())
    segments = news["R1"]["segments"]["items"]
    assert len(segments) == states[-1].segments_done > 0
    assert {s["basis_index"] for s in segments} <= {1, 2}
    assert all(len(s["points"]) >= 2 for s in segments)


def test_a_controller_that_is_done_is_not_missed(park):
    robot = robot_of(park, later_s=0.9)
    assert robot["line"] == "parking: parked"
    late = robot_of(park, later_s=4.0)
    assert {p["name"]: p["state"] for p in late["processes"]}["controller"] == "finished"
    assert not any("controller" in line for line in late["banners"])


def test_streams_that_fall_silent_are_named_with_who_should_speak(park):
    banners = robot_of(park, later_s=4.0)["banners"]
    by_plant = next(line for line in banners if "from the plant" in line)
    assert "stale for 4 s" in by_plant
    assert "R1_MOCAP_POSE" in by_plant
    # Commands flow only while somebody drives.
    assert not any("VELOCITY_CMD" in line for line in banners)
    assert robot_of(park, later_s=4.0)["line"] == "nothing heard for 4 s"


def test_a_commander_that_fell_silent_is_news_for_a_while_only():
    driving = seen("park.lcm", until_us=3_000_000)
    soon = robot_of(driving, later_s=5.0)["banners"]
    assert any("from the controller: R1_CONTROLLER_HEARTBEAT, R1_MPC_STATE" in b for b in soon)
    late = robot_of(driving, later_s=60.0)["banners"]
    assert not any("controller" in line or "commander" in line for line in late)
    assert any("from the plant" in line for line in late)


def test_who_commanded_is_not_missed_once_the_robot_rests_and_is_free():
    view, now_us = seen("park.lcm", until_us=3_000_000)
    status = lcmtypes.onboard_status_t()
    status.utime = now_us + 5_000_000
    view.take("R1_ONBOARD_STATUS", status.encode(), status.utime)
    robot = view.snapshot(status.utime)["R1"]
    assert not any("controller" in line or "commander" in line for line in robot["banners"])
    stale = {flow["name"] for flow in robot["channels"] if flow["stale"]}
    assert "R1_MOCAP_POSE" in stale
    assert "R1_MPC_STATE" not in stale


def test_a_replay_is_known_by_the_times_of_its_messages():
    robot = robot_of(seen("park.lcm", later_us=YEAR_US))
    assert robot["replay"]
    assert not robot["steerable"]
    assert robot["line"].startswith("replay: parking")


def test_a_replay_that_is_over_is_no_lab_that_fell_silent():
    replay = seen("park.lcm", later_us=YEAR_US)
    robot = robot_of(replay, later_s=30.0)
    assert robot["replay"]
    assert not robot["steerable"]
    assert robot["line"] == "replay: over for 30 s"
    assert robot["banners"] == []
    assert not any(flow["stale"] for flow in robot["channels"])
    # A robot that speaks there since is none.
    view, now_us = replay
    status = lcmtypes.onboard_status_t()
    status.utime = now_us + 40_000_000
    view.take("R1_ONBOARD_STATUS", status.encode(), status.utime)
    robot = view.snapshot(status.utime)["R1"]
    assert not robot["replay"]
    assert robot["steerable"]


def test_what_waited_while_a_process_stood_still_is_no_replay():
    view, now_us = seen("park.lcm", until_us=3_000_000)
    events = [e for e in read_rotated_log(REFERENCE / "park.lcm") if e.timestamp_us > 3_000_000]
    # All that was said since is read at once, half a minute late; then the robot speaks on.
    now_us += 30_000_000
    for k, event in enumerate(events):
        view.take(event.channel, event.data, now_us + 20 * k)
    robot = view.snapshot(now_us + 100_000)["R1"]
    assert not robot["replay"]
    assert not robot["steerable"]
    speak(view, "R1", now_us + 200_000)
    robot = view.snapshot(now_us + 200_000)["R1"]
    assert not robot["replay"]
    assert robot["steerable"]
    assert not robot["line"].startswith("replay")


def test_a_board_whose_clock_is_wrong_is_no_replay():
    view = LabView(load_config())
    status = lcmtypes.onboard_status_t()
    status.utime = 1
    pose = lcmtypes.mocap_pose_t()
    pose.utime = YEAR_US
    view.take("R1_ONBOARD_STATUS", status.encode(), YEAR_US)
    view.take("R1_MOCAP_POSE", pose.encode(), YEAR_US)
    robot = view.snapshot(YEAR_US)["R1"]
    assert not robot["replay"]
    assert robot["steerable"]


def process(**fields) -> bytes:
    message = lcmtypes.process_t()
    message.name, message.pid = "plant", 7
    for name, value in fields.items():
        setattr(message, name, value)
    return message.encode()


def heartbeat(pid: int) -> bytes:
    message = lcmtypes.node_status_t()
    message.pid = pid
    return message.encode()


def test_who_died_is_said_with_its_last_lines_until_it_is_there_again():
    view = LabView(load_config())
    view.take("R1_PLANT_HEARTBEAT", heartbeat(7), 0)
    told = process(state=2, ended="signal SIGKILL", last_lines="ouch", log_file="/x/plant.log")
    view.take("R1_PROCESS", told, 100_000)
    robot = view.snapshot(200_000)["R1"]
    assert robot["banners"][0].startswith("plant died (signal SIGKILL)")
    (plant,) = robot["processes"]
    assert (plant["state"], plant["last_lines"]) == ("died", "ouch")
    view.take("R1_PLANT_HEARTBEAT", heartbeat(8), 900_000)
    robot = view.snapshot(1_000_000)["R1"]
    assert robot["banners"] == []
    assert robot["processes"][0]["state"] == "alive"


def test_who_was_stopped_on_purpose_is_not_missed():
    view = LabView(load_config())
    view.take("R1_PLANT_HEARTBEAT", heartbeat(7), 0)
    view.take("R1_PROCESS", process(state=1, ended="exit code 0"), 1000)
    robot = view.snapshot(60_000_000)["R1"]
    assert robot["banners"] == []
    assert robot["processes"][0]["state"] == "finished"


def test_what_a_person_says_to_a_robot_is_no_sign_of_the_robot():
    view, now_us = seen("park.lcm")
    stop, late_us = lcmtypes.estop_t(), now_us + 10_000_000
    stop.utime, stop.engaged = late_us, True
    assert view.snapshot(now_us)["R1"]["steerable"]
    view.take("R1_ESTOP", stop.encode(), late_us)
    assert not view.snapshot(late_us)["R1"]["steerable"]


def test_a_reference_run_is_what_the_lab_is_doing():
    view = LabView(load_config())
    state = lcmtypes.reference_state_t()
    state.phase, state.runs_done, state.runs_total = state.RUN, 2, 20
    view.take("R1_REFERENCE_STATE", state.encode(), 0)
    assert view.snapshot(0)["R1"]["line"] == "reference run 3 of 20: driving"


def test_an_emergency_stop_is_what_the_lab_is_doing():
    view = LabView(load_config())
    status = lcmtypes.onboard_status_t()
    status.state = status.ESTOP
    view.take("R1_ONBOARD_STATUS", status.encode(), 0)
    robot = view.snapshot(0)["R1"]
    assert robot["stopped"]
    assert robot["line"] == "stopped: emergency stop; it stands until it is released"


def test_nonsense_on_the_bus_is_passed_over_and_never_breaks_the_snapshot():
    view, now_us = seen("park.lcm")
    for channel in channels.CHANNELS:
        whole = channel.type().encode()
        for data in (b"", b"x", whole[:20], bytes(len(whole)), whole[:8] + b"\xff" * 400):
            view.take(channel.name("R1"), data, now_us)
    pose = lcmtypes.mocap_pose_t()
    pose.x1_m, pose.x2_m, pose.theta_rad, pose.tracking_valid = math.nan, math.inf, 0.0, True
    view.take("R1_MOCAP_POSE", pose.encode(), now_us)
    for k in range(2000):
        view.take(f"ROBOT{k}_MOCAP_POSE", pose.encode(), now_us)
        view.take(f"other {k}", b"", now_us)
    assert len(view.robots) == 16
    json.dumps([view.snapshot(now_us), view.histories(())[0]], allow_nan=False)


def test_memory_stays_bounded_however_long_the_lab_runs():
    view = LabView(load_config())
    pose = lcmtypes.mocap_pose_t().encode()
    for k in range(5001):  # each but the first ends a row
        view.take("R1_MOCAP_POSE", pose, k * 50_000)
    rows = view.histories(())[0]["R1"]["rows"]
    assert (rows["first"], rows["begin"], len(rows["items"])) == (2600, 2600, 2400)


def test_what_keeps_a_robot_from_being_driven_is_on_the_page_as_long_as_it_does():
    view, message = LabView(load_config()), lcmtypes.interlock_t()
    message.reason = "outside the floor"
    view.take("R1_INTERLOCK", message.encode(), 1_000_000)
    assert "not driven: outside the floor" in view.snapshot(1_500_000)["R1"]["banners"]
    assert view.snapshot(2_500_000)["R1"]["banners"] == []
    message.utime, message.reason = 1_600_000, ""
    view.take("R1_INTERLOCK", message.encode(), 1_600_000)
    assert view.snapshot(1_700_000)["R1"]["banners"] == []

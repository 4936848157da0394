"""What a person asks a lab that is up, and how it is ended."""

import json
import os
import signal
import socket

import pytest
from klab import SMALL_AREA, alive, klab, klab_json, klab_ok, start_klab
from real_bus import Ear

from koopman_lab.bus.channels import HEARTBEATS, ONBOARD_STATUS, PROCESS
from koopman_lab.eventlog.eventlog import read_events
from offboard.terminal.exit_codes import ExitCode


@pytest.fixture
def up(bus_url, tmp_path, monkeypatch):
    """Bring a lab up; give its process and the ids of its children."""
    # What broke in other tests is remembered elsewhere.
    monkeypatch.setenv("KOOPMAN_LAB_CACHE", str(tmp_path / "cache"))
    ear = Ear(bus_url)
    process = start_klab("up", "--out", tmp_path / "up")
    yield process, ear.wait_for("plant", "onboard", "logger")
    process.kill()
    process.communicate()


def test_a_lab_says_who_is_there_and_what_flows_until_it_is_brought_down(up, bus_url, tmp_path):
    process, pids = up
    entries = {entry["name"]: entry for entry in klab_json("status")["R1"]}
    assert {name: entry["pid"] for name, entry in entries.items()} == pids
    assert {entry["state"] for entry in entries.values()} == {"alive"}
    log_file = str(tmp_path / "up" / "processes" / "plant.log")
    assert entries["plant"]["log_file"] == log_file
    assert entries["onboard"]["needs"] == ["plant"]
    assert "klab down" in entries["plant"]["stopped_by"]
    flows = {flow["name"]: flow for flow in klab_json("topics", "--once", "--seconds", "1")}
    assert {"R1_MOCAP_POSE", "R1_ENCODER", "R1_PROCESS", "R1_PLANT_HEARTBEAT"} <= flows.keys()
    assert flows["R1_MOCAP_POSE"]["nominal_hz"] == 240.0
    assert flows["R1_MOCAP_POSE"]["messages"] > 1
    pose = json.loads(klab_ok("topics", "--echo", "R1_MOCAP_POSE", "--once"))
    assert {"utime", "sequence", "x1_m", "tracking_valid"} <= pose.keys()
    os.kill(pids["plant"], signal.SIGSTOP)
    ear = Ear(bus_url)
    told = []
    ear.listener.subscribe(PROCESS, told.append)
    ear.wait(lambda: any((t.name, t.state) == ("plant", t.SILENT) for t in told))
    done = klab("status", "--json")
    states = {entry["name"]: entry["state"] for entry in json.loads(done.stdout)["R1"]}
    assert done.returncode == 1
    assert states == {"plant": "silent", "onboard": "alive", "logger": "alive"}
    os.kill(pids["plant"], signal.SIGCONT)
    assert "R1 is down" in klab("down").stderr
    process.communicate(timeout=60)
    assert process.returncode == 130
    assert not any(map(alive, pids.values()))


def test_who_commands_is_ended_first_and_who_goes_on_is_named(up, bus_url, tmp_path):
    process, _ = up
    ear = Ear(bus_url)
    beats = []
    ear.listener.subscribe(HEARTBEATS["logger"], beats.append)
    session = start_klab("calibrate", "--out", tmp_path / "session", *SMALL_AREA)
    by_hand = start_klab("run", "logger", "--out", tmp_path / "by-hand")
    try:
        ear.wait(lambda: ear.status is not None and abs(ear.status.v_setpoint_m_per_s) > 0.1)
        ear.wait(lambda: by_hand.pid in {beat.pid for beat in beats})
        down = klab("down")
        assert down.returncode == 1
        own = f"logger (process {by_hand.pid}: started by hand"
        assert f"R1 is not down; still there: {own}" in down.stderr
        for ended in (process, session):
            ended.communicate(timeout=60)
            assert ended.returncode == 130
        assert by_hand.poll() is None
    finally:
        for started in (session, by_hand):
            started.terminate()
            started.communicate(timeout=60)
    # The motor loop was there until the robot stood.
    messages = read_events(tmp_path / "by-hand" / "session.lcm")
    status = [m.data for m in messages if m.channel == ONBOARD_STATUS.name("R1")][-1]
    last = ONBOARD_STATUS.type.decode(status)
    assert (last.commander, last.v_setpoint_m_per_s, last.omega_setpoint_rad_per_s) == (0, 0.0, 0.0)


@pytest.mark.parametrize(
    ("command", "code", "said"),
    [
        (("down",), ExitCode.LAB_FAILURE, "no `klab up`, `calibrate` or `park` of this machine"),
        (("topics", "--once", "--seconds", "0.2"), ExitCode.LAB_FAILURE, "nothing heard in 0.2 s"),
        (("status",), 1, "no process heard"),
    ],
)
def test_where_nobody_is_that_is_said(command, code, said):
    done = klab(*command)
    assert done.returncode == code, done.stderr
    assert said in done.stderr
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize("command", [("view",), ("up", "--view")])
def test_a_port_that_is_taken_is_one_clear_message(command, bus_url):
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = str(taken.getsockname()[1])
        done = klab(*command, "--url", bus_url, "--port", port)
    assert done.returncode == ExitCode.LAB_FAILURE
    assert "page:" not in done.stdout + done.stderr
    assert f"--port {port}: cannot listen there" in done.stderr

"""What a person asks a lab that is up, and how it is ended."""

import json
import socket

import pytest
from klab import alive, klab, klab_json, klab_ok, start_klab
from test_real_time import Ear


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


def test_a_lab_says_who_is_there_and_what_flows_until_it_is_brought_down(up, tmp_path):
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
    assert "R1 is down" in klab("down").stderr
    process.communicate(timeout=60)
    assert process.returncode == 130
    assert not any(map(alive, pids.values()))


@pytest.mark.parametrize(
    ("command", "code", "said"),
    [
        (("down",), 2, "no `klab up`, `calibrate` or `park` of this machine"),
        (("topics", "--once", "--seconds", "0.2"), 2, "nothing heard in 0.2 s"),
        (("status",), 1, "no process heard"),
    ],
)
def test_where_nobody_is_that_is_said(command, code, said):
    done = klab(*command)
    assert done.returncode == code, done.stderr
    assert said in done.stderr
    assert "Traceback" not in done.stderr


def test_a_port_that_is_taken_is_one_clear_message(bus_url):
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = str(taken.getsockname()[1])
        done = klab("view", "--url", bus_url, "--port", port)
    assert done.returncode == 2
    assert f"--port {port}: cannot listen there" in done.stderr

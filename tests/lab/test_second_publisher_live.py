"""A second robot program under the name of a lab that is up, over real UDP."""

import json

import pytest
from klab import klab, klab_json, start_klab
from real_bus import Ear

from koopman_lab.bus.channels import HEARTBEATS
from koopman_lab.files import STATE_VARIABLE

NAMED = ("R1_MOCAP_POSE", "R1_ENCODER", "R1_ONBOARD_STATUS", "R1_WHEEL_STATE")


@pytest.fixture
def two_robots(bus_url, tmp_path, monkeypatch):
    """Bring a lab up, and beside it the programs of another robot, of the same name."""
    monkeypatch.setenv("KOOPMAN_LAB_CACHE", str(tmp_path / "cache"))
    ear, heard = Ear(bus_url), set()
    for name in ("plant", "onboard"):
        ear.listener.subscribe(HEARTBEATS[name], lambda beat: heard.add(beat.pid))
    lab = start_klab("up", "--out", tmp_path / "up")
    ear.wait_for("plant", "onboard", "logger")
    # Of another board, which knows nothing of the first one's lock.
    monkeypatch.setenv(STATE_VARIABLE, str(tmp_path / "another board"))
    others = [start_klab("run", "plant"), start_klab("run", "onboard", "--preset", "lab")]
    try:
        ear.wait(lambda: {process.pid for process in others} <= heard)
        yield lab, others, tmp_path / "up"
    finally:
        for process in (*others, lab):
            process.terminate()
            process.communicate(timeout=60)


def test_it_is_named_until_it_is_gone_and_in_the_log(two_robots):
    lab, others, folder = two_robots
    status = klab("status")
    assert status.returncode == 1
    assert "publishers; a second " in status.stderr
    assert "or give it another --robot-name than R1" in status.stderr
    topics = klab("topics", "--once")
    assert topics.returncode == 0
    for name in NAMED:
        assert name in topics.stderr
    assert "uses the name R1" in topics.stderr
    flows = {flow["name"]: flow for flow in klab_json("topics", "--once")}
    assert {flows[name]["publishers"] for name in NAMED} == {2}
    assert flows["R1_LOGGER_STATUS"]["publishers"] is None
    for process in others:
        process.terminate()
        process.communicate(timeout=60)
    alone = {flow["name"]: flow for flow in klab_json("topics", "--once")}
    assert {alone[name]["publishers"] for name in NAMED} == {1}
    status = klab("status")
    assert "uses the name" not in status.stderr
    lab.terminate()
    lab.communicate(timeout=60)
    info = klab("log", "info", folder)
    assert "R1_MOCAP_POSE" in info.stderr
    assert "2 publishers" in info.stderr
    channels = json.loads(klab("log", "info", folder, "--json").stdout)["channels"]
    assert {channels[name]["publishers"] for name in NAMED} == {2}
    assert channels["R1_LOGGER_STATUS"]["publishers"] == 1

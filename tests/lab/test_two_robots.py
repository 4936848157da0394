"""Two robots on one bus, each with its full stack, and nobody touches the other's."""

import json

import pytest
from klab import MODEL, SHORT_RUNS, klab, klab_ok, start_klab

from koopman_lab.bus.channels import ONBOARD_STATUS, split_name
from koopman_lab.bus.realtime import Listener
from koopman_lab.config.load import load_config
from koopman_lab.eventlog.eventlog import read_events
from offboard.terminal.exit_codes import ExitCode

MOST_WAITS = 600
WAIT_S = 0.05


@pytest.fixture
def robots(bus_url, tmp_path):
    """Bring two robots up on one bus; they end with the test."""
    started, heard = [], []
    try:
        for name in ("R1", "R2"):
            config = load_config(overrides=[f"bus.url={bus_url}", f"robot.name={name}"])
            listener = Listener(config)
            listener.subscribe(ONBOARD_STATUS, heard.append)
            started.append(start_klab("up", "--robot-name", name, "--out", tmp_path / name))
            for _ in range(MOST_WAITS):
                if heard:
                    break
                listener.spin(WAIT_S)
            assert heard, f"{name} is not up in time"
            heard.clear()
        yield "R1", "R2"
    finally:
        for process in started:
            process.terminate()
            process.communicate(timeout=30)


def wait_until_held(bus_url, name):
    listener = Listener(load_config(overrides=[f"bus.url={bus_url}", f"robot.name={name}"]))
    holders = []
    listener.subscribe(ONBOARD_STATUS, lambda status: holders.append(status.commander))
    for _ in range(MOST_WAITS):
        listener.spin(WAIT_S)
        if holders and holders[-1] != 0:
            return
    pytest.fail(f"nobody holds {name} in time")


def test_one_robot_is_calibrated_while_the_other_parks(robots, bus_url, tmp_path):
    calibrated, parked = robots
    folders = {calibrated: tmp_path / "calibration", parked: tmp_path / "park"}
    small = ("--segments", "2", *SHORT_RUNS)
    session = start_klab(
        "calibrate", "--robot-name", calibrated, "--out", folders[calibrated], *small
    )
    wait_until_held(bus_url, calibrated)
    refused = klab("calibrate", "--robot-name", calibrated, "--out", tmp_path / "second")
    assert refused.returncode == ExitCode.LAB_FAILURE, refused.stderr
    assert f"{calibrated}_ONBOARD_STATUS: the robot is held by sampler" in refused.stderr
    assert not (tmp_path / "second").exists()
    near = ("--start", "-0.4", "0.1", "20")
    klab_ok("park", "--robot-name", parked, "--model", MODEL, *near, "--out", folders[parked])
    said, _ = session.communicate(timeout=120)
    assert session.returncode == 0, said
    assert json.loads((folders[parked] / "summary.json").read_text())["parked"]
    assert json.loads((folders[calibrated] / "summary.json").read_text())["complete"]
    for name, folder in folders.items():
        statuses = []
        for event in read_events(folder / "session.lcm"):
            if event.channel == "LCM_SELF_TEST":
                continue
            robot, channel = split_name(event.channel)
            assert robot == name
            if channel is ONBOARD_STATUS:
                statuses.append(channel.type.decode(event.data))
        assert statuses[-1].accepted > 100
        assert {s.refused_commander for s in statuses} == {0}
        assert len({s.commander for s in statuses} - {0}) == 1

"""A lab that is not as a command needs it: silent cameras, two loggers, files in the way."""

import json
import subprocess

import pytest
from klab import MODEL, NO_RADIO_LOSS, SHORT_RUNS, klab, klab_ok, start_klab

from koopman_lab.bus.channels import HEARTBEATS
from koopman_lab.bus.realtime import Listener
from koopman_lab.config.load import load_config
from offboard.terminal.exit_codes import ExitCode

MOST_WAITS = 600
WAIT_S = 0.05


@pytest.fixture
def start(bus_url):
    """Start a command and wait until these nodes are heard; all of them end with the test."""
    started: list[subprocess.Popen[str]] = []
    listener = Listener(load_config(overrides=[f"bus.url={bus_url}"]))
    heard: set[str] = set()
    for name, channel in HEARTBEATS.items():
        listener.subscribe(channel, lambda _, name=name: heard.add(name))

    def begin(*arguments, until):
        started.append(start_klab(*arguments))
        for _ in range(MOST_WAITS):
            if until <= heard:
                return
            listener.spin(WAIT_S)
        pytest.fail(f"not heard in time: {until - heard}")

    yield begin
    for process in started:
        process.terminate()
        process.communicate(timeout=30)


def test_silent_cameras_are_said_and_not_waited_for(start, tmp_path):
    """The onboard loop's heartbeats go on all the while."""
    start("run", "onboard", until={"onboard"})
    done = klab("park", "--model", MODEL, "--out", tmp_path / "park")
    assert done.returncode == ExitCode.LAB_FAILURE, done.stderr
    assert "R1_MOCAP_POSE: silent" in done.stderr
    assert not (tmp_path / "park" / "summary.json").exists()


def test_the_logger_of_a_lab_that_is_up_is_not_taken_for_loss(start, tmp_path):
    start("up", *NO_RADIO_LOSS, "--out", tmp_path / "up", until={"plant", "onboard", "logger"})
    out = tmp_path / "session"
    klab_ok("calibrate", "--segments", "1", "--out", out, *SHORT_RUNS)
    assert json.loads((out / "summary.json").read_text())["messages_lost"] == 0


def test_a_model_file_that_cannot_be_written_is_said(tmp_path_factory, tmp_path):
    session = tmp_path_factory.mktemp("runs") / "session"
    klab_ok("calibrate", "--lockstep", "--segments", "3", "--out", session, *SHORT_RUNS)
    (tmp_path / "in-the-way").mkdir()
    done = klab("train", session, "--out", tmp_path / "in-the-way")
    assert done.returncode == ExitCode.LAB_FAILURE
    assert "in-the-way: cannot be written" in done.stderr
    assert "--out" in done.stderr
    assert [p.name for p in tmp_path.iterdir()] == ["in-the-way"]


def test_a_model_of_another_sampling_time_leaves_no_run(tmp_path):
    out = tmp_path / "park"
    done = klab(
        *("park", "--model", MODEL, "--set", "controller.dt_s=0.1"), *("--lockstep", "--out", out)
    )
    assert done.returncode == 2
    assert "controller.dt_s is 0.1" in done.stderr
    assert not out.exists()

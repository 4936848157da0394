"""A session that was interrupted goes on where it stopped."""

import json
import os
import shutil
import signal

import numpy as np
import pytest
from klab import NO_RADIO_LOSS, SHORT_RUNS, klab, klab_ok, start_klab
from old_keys import old_dump

from koopman_lab.bus.channels import HEARTBEATS, SAMPLER_STATE, SESSION_INFO
from koopman_lab.bus.realtime import Listener
from koopman_lab.config.load import load_config
from koopman_lab.data.decode import SessionLog
from koopman_lab.eventlog.eventlog import read_events
from koopman_lab.eventlog.logwriter import EventLogWriter, files_of_log
from offboard.terminal.exit_codes import ExitCode

LIMIT_S = 60.0
WAIT_S = 0.05


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    folder = tmp_path_factory.mktemp("runs") / "whole"
    klab_ok("calibrate", "--lockstep", "--segments", "4", "--out", folder, *SHORT_RUNS)
    return folder


def cut(whole, folder, done, *, old=False):
    """Make the folder of a session that ended by force in the run after ``done`` segments.

    What is ``old`` was recorded before the configuration's keys moved.
    """
    folder.mkdir()
    shutil.copy(whole / "config.yaml", folder)
    text = old_dump(load_config(whole / "config.yaml"))
    if old:
        (folder / "config.yaml").write_text(text)
    with EventLogWriter(folder / "session.lcm") as log:
        for event in read_events(whole / "session.lcm"):
            if event.channel == "R1_SAMPLER_STATE":
                state = SAMPLER_STATE.type.decode(event.data)
                if state.segments_done >= done and state.phase == state.BASIS:
                    return
            data = event.data
            if old and event.channel == "R1_SESSION_INFO":
                info = SESSION_INFO.type.decode(data)
                info.config_yaml = text
                data = info.encode()
            log.write(event.channel, data, event.timestamp_us)


@pytest.mark.parametrize("done", [0, 3])
def test_a_resumed_session_keeps_what_there_was_and_completes_it(whole, tmp_path, done):
    folder = tmp_path / "session"
    cut(whole, folder, done)
    first = (folder / "session.lcm").read_bytes()
    klab_ok("calibrate", "--resume", folder, "--lockstep")
    assert (folder / "session.lcm").read_bytes() == first
    summary = json.loads((folder / "summary.json").read_text())
    assert summary["complete"]
    assert summary["segments"] == 8
    log = SessionLog(folder)
    states = log.array(SAMPLER_STATE)
    assert np.all(np.diff(states["utime"]) > 0)
    assert np.all(np.diff(states["segments_done"]) >= 0)
    assert log.config() == load_config(folder / "config.yaml")
    assert json.loads(klab_ok("train", folder, "--out", tmp_path / "m.npz", "--json"))


@pytest.mark.parametrize("mode", [["--lockstep"], []], ids=["lockstep", "real time"])
def test_a_session_of_the_version_before_is_resumed_and_trains(whole, tmp_path, mode, bus_url):
    """Its processes read the configuration in its folder, in the keys of today and on this bus."""
    folder = tmp_path / "session"
    cut(whole, folder, 7, old=True)
    klab_ok("calibrate", "--resume", folder, "--url", bus_url, *mode)
    assert json.loads((folder / "summary.json").read_text())["complete"]
    config = load_config(folder / "config.yaml")
    assert config.bus.url == bus_url
    assert SessionLog(folder).config().simulation == config.simulation is not None
    klab_ok("train", folder, "--out", tmp_path / "m.npz")


def test_what_cannot_be_resumed_is_said(whole, tmp_path):
    for arguments, said in [
        ((whole,), "complete already, 8 of 8 segments"),
        ((tmp_path,), "no such log"),
        ((whole, "--seed", "3"), "goes on with its own configuration"),
    ]:
        done = klab("calibrate", "--lockstep", "--resume", *arguments)
        assert done.returncode == 2
        assert said in done.stderr
        assert "Traceback" not in done.stderr


@pytest.mark.parametrize("victim", ["logger", "sampler", "plant"])
def test_a_process_killed_in_the_middle_costs_nothing_recorded(bus_url, tmp_path, victim):
    config = load_config(overrides=[f"bus.url={bus_url}"])
    listener, pids, states = Listener(config), {}, []
    for name, channel in HEARTBEATS.items():
        listener.subscribe(channel, lambda m, name=name: pids.update({name: m.pid}))
    listener.subscribe(SAMPLER_STATE, states.append)
    folder = tmp_path / "session"
    session = start_klab(
        *("calibrate", "--segments", "1", "--out", folder), *SHORT_RUNS, *NO_RADIO_LOSS
    )
    end_us = listener.now_us() + LIMIT_S * 1e6
    while victim not in pids or not (states and states[-1].phase == states[-1].BASIS):
        listener.spin(WAIT_S)
        assert listener.now_us() < end_us, "no basis input in time"
    os.kill(pids[victim], signal.SIGKILL)
    struck_us = listener.now_us()
    said, _ = session.communicate(timeout=LIMIT_S)
    assert session.returncode == ExitCode.LAB_FAILURE
    assert f"{victim} died (signal SIGKILL)" in said
    assert f"klab calibrate --resume {folder}" in said
    before = SessionLog(folder).array(SAMPLER_STATE)["utime"]
    assert struck_us - before[-1] < 0.3e6 or victim != "logger"
    # In real time once; on virtual time the same happens sooner.
    klab_ok("calibrate", "--resume", folder, *([] if victim == "logger" else ["--lockstep"]))
    assert json.loads((folder / "summary.json").read_text())["complete"]
    assert len(files_of_log(folder / "session.lcm")) == 2
    after = SessionLog(folder).array(SAMPLER_STATE)["utime"]
    np.testing.assert_array_equal(after[: len(before)], before)

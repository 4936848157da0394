"""The whole system over real UDP: processes, signals, the wheel's own LCM tools."""

import json
import os
import signal
import subprocess
import sys

import pytest
from klab import (
    KLAB,
    MODEL,
    NO_RADIO_LOSS,
    SHORT_RUNS,
    SMALL_AREA,
    klab,
    klab_ok,
    start_klab,
)
from real_bus import Ear, config, other, recorded, tool

import lcmtypes
from koopman_lab.bus import multicast, priority
from koopman_lab.bus.channels import (
    CHANNELS,
    ONBOARD_STATUS,
    REPLAY_CONTROL,
    REPLAY_STATE,
)
from offboard.commands.rerun_node import REAL_TIME_SHARE
from offboard.lab.process_notes import broken_labs
from offboard.terminal.exit_codes import ExitCode

LARGEST_SHARE_MISSED = 0.05
"""Of lcm-logger, on a machine that other tests keep busy; `klab bench logger` counts it alone."""
STANDING = ("plant", "onboard", "logger")


@pytest.fixture
def ear(bus_url):
    return Ear(bus_url)


@pytest.fixture
def up(ear, tmp_path):
    """Start `klab up`; yield it and its children's process ids."""
    process = start_klab("up", "--out", tmp_path / "up")
    try:
        yield process, ear.wait_for(*STANDING)
    finally:
        process.kill()
        process.wait()
        process.stdout.close()


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGKILL])
def test_no_process_outlives_the_supervisor(up, ear, number):
    process, pids = up
    process.send_signal(number)
    code = process.wait(timeout=30)
    assert code == (-signal.SIGKILL if number is signal.SIGKILL else 130)
    ear.wait_until_gone(pids)
    lost = broken_labs(ear.url, ear.listener.now_us()).get("R1", [])
    left = set(STANDING) if number is signal.SIGKILL else set()
    assert {entry.name for entry in lost} == left


@pytest.mark.usefixtures("up")
def test_the_motor_loop_of_a_lab_does_what_its_file_says(tmp_path):
    folder = tmp_path / "up"
    said = (folder / "processes" / "onboard.log").read_text()
    source = folder / "config.yaml"
    assert said == f"R1 (kinematic), {source}: radio, clock and faults are simulated\n"


@pytest.mark.parametrize("victim", STANDING)
def test_a_process_that_dies_is_named_and_the_others_stop(up, ear, victim, tmp_path):
    process, pids = up
    os.kill(pids[victim], signal.SIGKILL)
    said, _ = process.communicate(timeout=60)
    assert process.returncode == ExitCode.LAB_FAILURE
    assert f"{victim} died (signal SIGKILL)" in said
    file = str(tmp_path / "up" / "processes" / f"{victim}.log")
    assert file in said
    ear.wait_until_gone(pids)
    # Whoever asks later is told as well.
    (entry,) = broken_labs(ear.url, ear.listener.now_us())["R1"]
    assert (entry.name, entry.pid, entry.report.log_file) == (victim, pids[victim], file)
    assert entry.report.ended == "signal SIGKILL"


@pytest.mark.usefixtures("up")
def test_the_emergency_stop_holds_until_it_is_released(ear):
    kind = lcmtypes.onboard_status_t
    klab_ok("estop")
    ear.wait(lambda: ear.status is not None and ear.status.state == kind.ESTOP)
    klab_ok("estop", "--release")
    ear.wait(lambda: ear.status.state == kind.REST)


def test_a_second_lab_on_the_same_bus_is_refused(up, ear, tmp_path, monkeypatch):
    second = ("up", "--out", tmp_path / "second")
    done = klab(*second)
    assert done.returncode == ExitCode.LAB_FAILURE
    assert f"process {up[0].pid} runs the lab of R1 already on {ear.url}" in done.stderr
    # Another user, or a person at another machine, has only heard it.
    monkeypatch.setenv("KOOPMAN_LAB_CACHE", str(tmp_path / "cache"))
    done = klab(*second)
    assert done.returncode == ExitCode.LAB_FAILURE
    assert "of R1 already on" in done.stderr
    assert not (tmp_path / "second").exists()


def test_interrupting_a_session_half_way_keeps_its_log_and_stops_the_robot(ear, tmp_path):
    out = tmp_path / "calibration"
    process = start_klab("calibrate", "--out", out, *SMALL_AREA)
    pids = ear.wait_for(*STANDING, "sampler")
    ear.wait(lambda: ear.status is not None and abs(ear.status.v_setpoint_m_per_s) > 0.1)
    process.send_signal(signal.SIGINT)
    said, _ = process.communicate(timeout=60)
    assert process.returncode == 130
    assert str(out / "session.lcm") in said
    ear.wait_until_gone(pids)
    statuses = recorded(out / "session.lcm")["R1_ONBOARD_STATUS"]
    speeds = [abs(ONBOARD_STATUS.type.decode(data).v_setpoint_m_per_s) for data in statuses]
    assert max(speeds) > 0.1
    assert not (out / "summary.json").exists()


def last_index(messages: list[bytes], wanted: bytes) -> int:
    return len(messages) - 1 - messages[::-1].index(wanted)


def test_session_beside_lcm_logger_replayed_by_lcm_logplayer(bus_url, tmp_path):
    """Both loggers record the same, and a replayed log trains the same model to the last bit."""
    theirs, ours = tmp_path / "theirs.lcm", tmp_path / "session" / "session.lcm"
    # With the receive buffer that our processes ask for, or a busy machine makes it lose some.
    url = multicast.bus_url(config(bus_url))
    peer = subprocess.Popen(
        [tool("lcm-logger"), f"--lcm-url={url}", "--quiet", str(theirs)],
        stdout=subprocess.DEVNULL,
        # Before everybody, or others push it aside for longer than its queue lasts.
        preexec_fn=lambda: priority.ask_for_priority(2 * priority.PRIORITY),
    )
    try:
        klab_ok("calibrate", "--segments", "3", "--out", ours.parent, *SHORT_RUNS, *NO_RADIO_LOSS)
    finally:
        peer.terminate()
        assert peer.wait(timeout=10) == 0
    summary = json.loads((ours.parent / "summary.json").read_text())
    assert summary["complete"]
    assert summary["messages_lost"] == 0
    mine, peers = recorded(ours), recorded(theirs)
    # LCM sends this one by itself, whenever somebody opens the bus.
    peers.pop("LCM_SELF_TEST", None)
    for channel in CHANNELS:
        if not channel.logged and channel not in (REPLAY_CONTROL, REPLAY_STATE):
            assert peers.pop(channel.name("R1"))
    assert mine.keys() == peers.keys()
    missed = 0
    for channel, messages in mine.items():
        # Of ours nothing may be missing. lcm-logger began before and ended after us; it keeps no
        # more than 30 messages, which a stall of the machine fills in 50 ms.
        theirs_too = set(peers[channel])
        both = [message for message in messages if message in theirs_too]
        first, last = peers[channel].index(both[0]), last_index(peers[channel], both[-1])
        assert both == peers[channel][first : last + 1], channel
        missed += len(messages) - len(both)
    assert missed <= LARGEST_SHARE_MISSED * sum(map(len, mine.values()))

    for node in ("sampler", "onboard"):
        # One tick more or less in a phase, and what counts ticks differs from there on; how much
        # is the machine's affair, but what is said of it must be so.
        done = klab("rerun", ours.parent, "--node", node, "--json")
        again = json.loads(done.stdout)
        assert not again["lockstep"]
        assert 0.0 < again["share"] <= 1.0
        assert done.returncode == (again["share"] < REAL_TIME_SHARE)

    replay_url = other(bus_url)
    logger = subprocess.Popen(
        [*KLAB, "run", "logger", "--url", replay_url, "--out", str(tmp_path / "replay")]
    )
    replay_ear = Ear(replay_url)
    replay_ear.wait_for("logger")
    subprocess.run(
        [tool("lcm-logplayer"), f"--lcm-url={replay_url}", "--speed=10", str(ours)],
        check=True,
        stdout=subprocess.DEVNULL,
    )
    last = peers["R1_SAMPLER_STATE"][-1]
    replayed = tmp_path / "replay" / "session.lcm"
    replay_ear.wait(lambda: last in recorded(replayed).get("R1_SAMPLER_STATE", []))
    logger.send_signal(signal.SIGINT)
    assert logger.wait(timeout=10) == 0
    for name, folder in (("a", ours.parent), ("b", replayed.parent)):
        klab_ok("train", folder, "--out", tmp_path / f"{name}.npz")
    assert (tmp_path / "a.npz").read_bytes() == (tmp_path / "b.npz").read_bytes()


def test_parking_on_a_lab_that_is_up(up, ear, tmp_path):
    """`klab park` uses the processes that run already and leaves them running.

    The goal moves while the robot drives.
    """
    del up
    out = tmp_path / "park"
    ear.pids.clear()
    begin_and_end = ("--start", "-0.4", "0.1", "20", "--goal", "1", "0", "0")
    park = start_klab("park", "--model", MODEL, *begin_and_end, "--out", out)
    ear.wait(lambda: ear.status is not None and ear.status.v_setpoint_m_per_s > 0.1)
    klab_ok("goal", "0", "0", "0")
    said, _ = park.communicate(timeout=60)
    assert park.returncode == 0, said
    summary = json.loads((out / "summary.json").read_text())
    assert summary["parked"]
    assert summary["goal"] == [0.0, 0.0, 0.0]
    assert summary["mocap_messages_lost"] == 0
    assert len(summary["final_pose"]) == 3
    assert not (out / "processes" / "plant.log").exists()
    pids = dict(ear.pids)
    ear.pids.clear()
    assert ear.wait_for("plant", "onboard").items() <= (ear.pids | pids).items()


def test_a_missing_session_names_the_command_that_makes_one(tmp_path):
    done = subprocess.run(
        [sys.executable, "-m", "offboard.cli.main", "train", str(tmp_path)],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 2
    assert "session.lcm" in done.stderr

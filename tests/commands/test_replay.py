"""A log sent again: everybody sees it as live, and no robot moves."""

import math
import os
import pty
import signal
import subprocess
from contextlib import contextmanager
from pathlib import Path

import pytest
from klab import KLAB, SHORT_RUNS, controlled_by, klab, klab_ok
from real_bus import Ear, config, other, recorded, tool

from koopman_lab.bus.channels import (
    MOCAP_POSE,
    ONBOARD_STATUS,
    PLANT_TRUTH,
    REPLAY_CONTROL,
    REPLAY_STATE,
)
from koopman_lab.bus.realtime import Listener
from koopman_lab.eventlog.eventlog import read_events
from koopman_lab.replay.bus_steering import Control, control_message
from offboard.terminal.exit_codes import ExitCode

REFERENCE = Path(__file__).parents[1] / "data" / "reference" / "calibration.lcm"

LAST = "R1_SAMPLER_STATE"


@pytest.fixture(scope="module")
def session(tmp_path_factory):
    folder = tmp_path_factory.mktemp("runs") / "calibration"
    klab_ok("calibrate", "--lockstep", "--segments", "3", "--out", folder, *SHORT_RUNS)
    return folder


@pytest.mark.parametrize("speed", ["10", "40"])
def test_a_replayed_session_trains_the_same_model_at_any_speed(session, speed, bus_url, tmp_path):
    url, copy = other(bus_url), tmp_path / "copy"
    logger = subprocess.Popen([*KLAB, "run", "logger", "--url", url, "--out", str(copy)])
    ear = Ear(url)
    ear.wait_for("logger")
    done = klab("replay", session, "--speed", speed, "--url", url)
    assert done.returncode == 0, done.stderr
    last = recorded(session / "session.lcm")[LAST][-1]
    ear.wait(lambda: last in recorded(copy / "session.lcm").get(LAST, []))
    logger.send_signal(signal.SIGINT)
    assert logger.wait(timeout=10) == 0
    for name, folder in (("a", session), ("b", copy)):
        klab_ok("train", folder, "--out", tmp_path / f"{name}.npz")
    assert (tmp_path / "a.npz").read_bytes() == (tmp_path / "b.npz").read_bytes()


def test_a_replay_onto_the_bus_of_a_live_robot_is_refused(session, bus_url):
    onboard = subprocess.Popen([*KLAB, "run", "onboard", "--url", bus_url])
    try:
        Ear(bus_url).wait_for("onboard")
        done = klab("replay", session, "--url", bus_url)
    finally:
        onboard.send_signal(signal.SIGINT)
        assert onboard.wait(timeout=10) == 0
    assert done.returncode == ExitCode.LAB_FAILURE
    assert f"R1 is alive on {bus_url} (onboard)" in done.stderr
    assert "--url" in done.stderr
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize("preset", ["real", "lab"])
def test_lcm_logplayer_on_the_bus_of_a_live_robot_does_not_move_it(bus_url, preset):
    """Nothing warns who plays a log this way; so the robot itself must tell it from the living."""
    common = ("--url", bus_url)
    commands = ("run", "plant", *common), ("run", "onboard", "--preset", preset, *common)
    nodes = [subprocess.Popen([*KLAB, *command]) for command in commands]
    poses, statuses = [], []
    try:
        ear = Ear(bus_url)

        def keep(kept):
            def note(message):
                if abs(ear.listener.now_us() - message.utime) < 2_000_000:
                    kept.append(message)

            return note

        ear.listener.subscribe(PLANT_TRUTH, keep(poses))
        ear.listener.subscribe(ONBOARD_STATUS, keep(statuses))
        ear.wait(lambda: len(poses) > 100 and statuses)
        player = subprocess.Popen(
            [tool("lcm-logplayer"), f"--lcm-url={bus_url}", "--speed=4", str(REFERENCE)],
            stdout=subprocess.DEVNULL,
        )
        ear.wait(lambda: player.poll() is not None)
        count = len(statuses)
        ear.wait(lambda: len(statuses) > count + 3)
    finally:
        for node in nodes:
            node.send_signal(signal.SIGINT)
            assert node.wait(timeout=10) == 0
    last, start = statuses[-1], poses[0]
    assert last.accepted == 0
    assert last.refused_stale > 100
    assert last.state == last.REST
    # Where the onboard process was kept from running, a motor duty may get through until it speaks.
    moved = [math.hypot(p.x1_m - start.x1_m, p.x2_m - start.x2_m) for p in poses]
    assert max(moved) < 0.02


def test_a_damaged_log_is_replayed_as_far_as_it_goes_and_says_what_it_skips(
    session, bus_url, tmp_path
):
    whole = (session / "session.lcm").read_bytes()
    begin = len(whole) // 2
    path = tmp_path / "damaged.lcm"
    path.write_bytes(whole[:begin] + bytes(300) + whole[begin + 300 :])
    done = klab("replay", path, "--speed", "1000", "--url", other(bus_url))
    assert done.returncode == 0, done.stderr
    assert "damaged, passed over: " in done.stderr
    assert "events of" in done.stderr


@pytest.mark.parametrize("speed", ["0", "-1", "inf", "nan"])
def test_a_speed_that_is_none_is_refused(session, speed):
    done = klab("replay", session, "--speed", speed)
    assert done.returncode == 2
    assert "--speed" in done.stderr
    assert "Traceback" not in done.stderr


def test_interrupting_a_replay_is_clean(session, bus_url):
    process = subprocess.Popen(
        [*KLAB, "replay", str(session), "--url", other(bus_url)],
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )
    said = process.stderr.readline()
    assert "replaying" in said
    process.send_signal(signal.SIGINT)
    _, rest = process.communicate(timeout=30)
    assert process.returncode == 130
    assert "interrupted after" in rest
    assert "Traceback" not in rest


def replayed(log, url, *options):
    """Run a replay to its end; return what it said, and the channels with their messages."""
    heard = {}
    listener = Listener(config(url))
    listener.overhear(lambda name, data, _: heard.setdefault(name, []).append(data))
    done = klab("replay", log, "--url", url, *options)
    while listener.spin(0.0):
        pass
    return done, {name: list(all_of) for name, all_of in heard.items()}


def test_a_stretch_of_some_channels_is_sent_and_nothing_else(session, bus_url):
    events = list(read_events(session / "session.lcm"))
    first = events[0].timestamp_us
    only = {"R1_SAMPLER_STATE", "R1_WHEEL_STATE"}
    done, heard = replayed(
        session,
        other(bus_url),
        *("--start", "2", "--end", "5.5", "--speed", "20"),
        *("--only", "R1_SAMPLER_STATE", "--only", "R1_WHEEL_*"),
    )
    assert done.returncode == 0, done.stderr
    assert heard.keys() - {"R1_REPLAY_STATE", "LCM_SELF_TEST"} == only
    for name in only:
        inside = [
            event.data
            for event in events
            if event.channel == name and 2_000_000 <= event.timestamp_us - first <= 5_500_000
        ]
        assert heard[name] == inside
        assert len(inside) > 50


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--start", "-1"), "--start -1: "),
        (("--start", "1e9"), "--start 1e+09: "),
        (("--start", "nan"), "--start': nan is no number"),
        (("--start", "2", "--end", "2"), "--end 2: must be above --start 2"),
        (("--end", "nan"), "--end': nan is no number"),
        (("--only", "R1_POSE"), "no channel is --only R1_POSE; there are: R1_"),
    ],
)
def test_a_stretch_or_channel_that_is_not_there_is_refused(session, options, words):
    done = klab("replay", session, *options)
    assert done.returncode == 2
    assert words in " ".join(done.stderr.split())
    assert "Traceback" not in done.stderr


@contextmanager
def steered(log, url, *options):
    """Give a replay at a terminal of its own, and an ear that hears where it is."""
    ours, theirs = pty.openpty()
    ear, states = Ear(url), []
    ear.listener.subscribe(REPLAY_STATE, states.append)
    process = subprocess.Popen(
        [*KLAB, "replay", str(log), "--url", url, *options],
        stdin=theirs,
        stderr=subprocess.PIPE,
        start_new_session=True,
        preexec_fn=controlled_by(theirs),
    )
    try:
        ear.wait(lambda: states)
        yield ear, states, lambda keys: os.write(ours, keys)
    finally:
        process.send_signal(signal.SIGINT)
        _, said = process.communicate(timeout=30)
        os.close(ours)
        os.close(theirs)
    assert process.returncode == 130
    assert b"Traceback" not in said


def test_keys_pause_it_and_go_on_elsewhere_and_faster(session, bus_url):
    with steered(session, other(bus_url), "--paused", "--loop") as (ear, states, press):
        poses = []
        ear.listener.subscribe(MOCAP_POSE, poses.append)
        assert not states[-1].playing
        assert states[-1].position_s == 0.0
        assert states[-1].loop
        # Paused, it shows what was said last where it is.
        press(b"\x1b[C")
        ear.wait(lambda: states[-1].position_s == 5.0 and poses)
        assert len(poses) == 1
        press(b" ")
        ear.wait(lambda: states[-1].playing and len(poses) > 100)
        press(b"\x1b[A\x1b[A")
        ear.wait(lambda: states[-1].speed == 4.0)
        press(b"\x1b[D\x1b[D\x1b[D ")
        ear.wait(lambda: not states[-1].playing and states[-1].seeks == 4)
        assert states[-1].position_s < 5.0


def test_messages_on_its_bus_steer_it_once_each(session, bus_url):
    with steered(session, other(bus_url), "--paused") as (ear, states, _):
        kind = REPLAY_CONTROL.type

        def ask(action, value, number):
            message = control_message(Control(action, value), number, ear.listener.now_us())
            ear.listener.publish(REPLAY_CONTROL, message)

        ask(kind.SEEK, 3.5, 7)
        ear.wait(lambda: states[-1].position_s == 3.5)
        ask(kind.SPEED, 0.5, 8)
        ask(kind.SEEK, 1.0, 7)  # said once more, or late
        ask(kind.SEEK, math.nan, 9)
        ask(99, 1.0, 10)
        ear.wait(lambda: states[-1].control == 10)
        assert (states[-1].position_s, states[-1].speed) == (3.5, 0.5)
        assert states[-1].seeks == 1
        ask(kind.PLAY, 0.0, 11)
        ear.wait(lambda: states[-1].playing and states[-1].position_s > 3.6)

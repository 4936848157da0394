"""A log sent again: everybody sees it as live, and no robot moves."""

import math
import signal
import subprocess
from pathlib import Path

import pytest
from klab import KLAB, SHORT_RUNS, klab, klab_ok
from real_bus import Ear, other, recorded, tool

from koopman_lab.bus.channels import ONBOARD_STATUS, PLANT_TRUTH
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

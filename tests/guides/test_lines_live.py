"""The lines behind the first hour that need a lab, a bus or Ctrl-C, in terminals."""

import json
import re
import subprocess
import urllib.request

import pytest
from guide_pages.pages import REPLAYS
from guide_pages.terminals import ENDED, LIMIT_S, Terminal, run, typed
from klab import KLAB, MODEL, SHORT_RUNS, klab, klab_ok
from real_bus import Ear, recorded, tool

from koopman_lab.bus.channels import MOCAP_POSE

LAST = "R1_SAMPLER_STATE"


@pytest.fixture
def ear(bus_url):
    return Ear(bus_url)


def test_a_lab_in_one_terminal_and_what_is_typed_in_another(tmp_path, ear):
    parking = ("park", "--model", MODEL, "--start", "0", "0.5", "0", "--out", tmp_path / "park")
    stays = ("--set", "controller.parked_hold_s=1000", "--set", "controller.time_limit_s=1000")
    with Terminal("klab up --robot kinematic", tmp_path) as up:
        ear.wait_for("plant", "onboard", "logger")
        assert "onboard" in run("klab status", tmp_path)
        ear.wait(lambda: ear.status is not None)
        assert json.loads(run("klab topics --once --json", tmp_path))
        run("klab estop", tmp_path)
        run("klab estop --release", tmp_path)
        with subprocess.Popen([*KLAB, *map(str, (*parking, *stays))], text=True) as park:
            with Terminal("klab topics --echo R1_MPC_STATE", tmp_path) as echo:
                assert "goal" in json.loads(echo.until("{"))
                echo.interrupt()
            run("klab goal 0.5 0.2 90", tmp_path)
            run("klab fault occlusion --duration-s 0.8", tmp_path)
            run("klab fault motor-stalled --wheel left --duration-s inf", tmp_path)
            assert park.wait(timeout=LIMIT_S) == 1
            run("klab fault motors-exchanged --duration-s 2", tmp_path)
        with Terminal("klab topics", tmp_path) as topics:
            assert topics.until("MOCAP_POSE")
            topics.end()  # which it does by itself where nobody looks
        run("klab down", tmp_path)
        assert up.process.wait(timeout=LIMIT_S) in ENDED


def test_the_page_alone_and_with_a_lab(tmp_path):
    for line in ("klab view", "klab up --view --port 8765"):
        with Terminal(line, tmp_path) as view:
            address = re.search(r"http://\S+?/", view.until("http://")).group()
            assert address == "http://127.0.0.1:8765/"
            page = urllib.request.urlopen(address, timeout=LIMIT_S).read().decode()
            assert "STOP" in page
            view.interrupt()


def test_the_bus_is_shown_to_foxglove(tmp_path):
    with Terminal("klab foxglove", tmp_path) as foxglove:
        assert foxglove.until("ws://127.0.0.1:8767")
        foxglove.interrupt()


def test_each_process_in_a_terminal_of_its_own(tmp_path, ear):
    (tmp_path / "runs").mkdir()
    with (
        Terminal("klab run plant --robot kinematic", tmp_path) as plant,
        Terminal("klab run onboard --robot kinematic --preset lab", tmp_path) as onboard,
        Terminal("klab run logger --robot kinematic --out runs/by-hand", tmp_path) as logger,
    ):
        ear.wait_for("plant", "onboard", "logger")
        ear.wait(lambda: ear.status is not None)
        for terminal in (plant, onboard, logger):
            terminal.interrupt()
    assert (tmp_path / "runs" / "by-hand" / "session.lcm").stat().st_size


def test_a_replay_and_who_listens_to_it(tmp_path):
    runs = tmp_path / "runs"
    runs.mkdir()
    klab_ok(
        *("calibrate", "--lockstep", "--segments", "3", *SHORT_RUNS),
        *("--out", runs / "calibration"),
    )
    ear, frames = Ear(REPLAYS), []
    ear.listener.subscribe(MOCAP_POSE, frames.append)
    logger = f'klab run logger --robot kinematic --url "{REPLAYS}" --out runs/replay'
    with Terminal(logger, tmp_path) as recording:
        ear.wait_for("logger")
        run("klab replay runs/calibration --speed 4", tmp_path)
        last = recorded(runs / "calibration" / "session.lcm")[LAST][-1]
        ear.wait(lambda: last in recorded(runs / "replay" / "session.lcm").get(LAST, []))
        recording.interrupt()
    ear.wait(lambda: frames)
    some = "klab replay runs/calibration --start 2 --end 8 --speed 4 --only *_MOCAP_POSE"
    assert "of 6.0 s sent" in klab(*typed(some)[1:], cwd=tmp_path).stderr
    run("klab train runs/replay --out runs/replayed.npz", tmp_path)
    klab_ok("train", runs / "calibration", "--out", runs / "original.npz")
    assert (runs / "replayed.npz").read_bytes() == (runs / "original.npz").read_bytes()
    while ear.listener.spin(0.0):
        pass
    frames.clear()
    words = typed(f'lcm-logplayer --lcm-url="{REPLAYS}" --speed=4 runs/calibration/session.lcm')
    player = subprocess.Popen([tool(words[0]), *words[1:]], cwd=tmp_path, stdout=subprocess.DEVNULL)
    ear.wait(lambda: player.poll() is not None)
    assert player.returncode == 0
    assert frames


def test_a_second_robot_is_calibrated_beside_the_first(tmp_path):
    """Commands for the second robot find its own lab."""
    run_of = "klab calibrate --robot-name R2 --robot dynamic --segments 4 --out runs/second-robot"
    (tmp_path / "runs").mkdir()
    with Terminal("klab up --robot-name R2 --robot dynamic", tmp_path) as up:
        assert up.until("R2")
        run(run_of, tmp_path, "--segments", "1", *SHORT_RUNS)
        run("klab estop --all", tmp_path)
        run("klab estop --all --release", tmp_path)
        run("klab down --all", tmp_path)
        assert up.process.wait(timeout=LIMIT_S) in ENDED
    assert (tmp_path / "runs" / "second-robot" / "session.lcm").exists()


def test_a_lab_with_a_key_and_guests_who_look_on(tmp_path):
    (tmp_path / "runs").mkdir()
    run("klab key new lab.key", tmp_path)
    guests = "klab relay --read-only --to udpm://239.255.76.69:7669?ttl=0"
    with (
        Terminal("klab up --set bus.key_file=lab.key", tmp_path) as up,
        Terminal(guests, tmp_path) as relay,
    ):
        ear = Ear("udpm://239.255.76.69:7669?ttl=0")
        ear.wait_for("plant", "onboard", "logger")
        ear.wait(lambda: ear.status is not None)
        run("klab estop --set bus.key_file=lab.key", tmp_path)
        assert "R1_MOTOR_CMD" in run("klab topics --once --set bus.key_file=lab.key", tmp_path)
        relay.interrupt()
        run("klab down --set bus.key_file=lab.key", tmp_path)
        assert up.process.wait(timeout=LIMIT_S) in ENDED

"""The README's lines that need a lab, a bus or Ctrl-C, typed in as many terminals as it says.

Its other lines are run by tests/packaging/test_blocks.py and test_first_hour.py.
"""

import json
import re
import shlex
import signal
import subprocess
import urllib.request
from pathlib import Path

import pytest
from klab import KLAB, MODEL, SHORT_RUNS, klab, klab_ok
from test_real_time import Ear, recorded, tool

from koopman_lab.bus.channels import MOCAP_POSE

README = Path(__file__).parents[2] / "README.md"
LINES = {
    tuple(shlex.split(line, comments=True))
    for block in re.findall(r"^```bash\n(.*?)^```", README.read_text(), re.M | re.S)
    for line in block.splitlines()
}
REPLAYS = "udpm://239.255.76.68:7668?ttl=0"
LAST = "R1_SAMPLER_STATE"
LIMIT_S = 60.0
ENDED = (0, 130)
"""Exit codes of what Ctrl-C ends."""


def typed(line: str) -> list[str]:
    """Return the words of a line, which must be one of the README."""
    words = shlex.split(line)
    assert tuple(words) in LINES, f"README: has no line `{line}` any more"
    return words


def run(line: str, cwd: Path, *shorter: str) -> str:
    """Run a line to its end, expect success, return what it printed."""
    done = klab(*typed(line)[1:], *shorter, cwd=cwd)
    assert done.returncode == 0, f"{line}\n{done.stderr}"
    return done.stdout


class Terminal:
    """One in which a line runs until it is interrupted."""

    def __init__(self, line: str, cwd: Path, *shorter: str) -> None:
        self.process = subprocess.Popen(
            [*KLAB, *typed(line)[1:], *shorter],
            cwd=cwd,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
        )

    def __enter__(self):
        return self

    def __exit__(self, *raised) -> None:
        self.process.kill()
        self.process.wait()
        self.process.stdout.close()

    def until(self, word: str) -> str:
        """Return the first line that holds a word."""
        return next(line for line in self.process.stdout if word in line)

    def interrupt(self) -> None:
        """Press Ctrl-C."""
        self.process.send_signal(signal.SIGINT)
        assert self.process.wait(timeout=LIMIT_S) in ENDED


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
        with Terminal("klab topics", tmp_path) as topics:
            assert topics.until("MOCAP_POSE")
            topics.interrupt()
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


@pytest.mark.parametrize(
    "lines",
    [
        ("klab run plant", "klab run onboard"),
        (
            "klab run plant --robot kinematic",
            "klab run onboard --robot kinematic",
            "klab run logger --robot kinematic --out runs/by-hand",
        ),
    ],
    ids=["two machines", "three terminals"],
)
def test_each_process_in_a_terminal_of_its_own(lines, tmp_path, ear):
    (tmp_path / "runs").mkdir()
    terminals = [Terminal(line, tmp_path) for line in lines]
    try:
        ear.wait_for(*(line.split()[2] for line in lines))
        ear.wait(lambda: ear.status is not None)
        assert "MOCAP_POSE" in run("klab topics --once", tmp_path)
        for terminal in terminals:
            terminal.interrupt()
    finally:
        for terminal in terminals:
            terminal.__exit__()
    made = [line for line in lines if "--out" in line]
    assert all((tmp_path / "runs" / "by-hand" / "session.lcm").stat().st_size for _ in made)


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
        up.interrupt()
    assert (tmp_path / "runs" / "second-robot" / "session.lcm").exists()


SHOWN_BY = (
    *("klab up", "klab estop", "klab goal", "klab status", "klab down", "klab run", "klab view"),
    *("klab topics", "klab fault", "klab replay", "lcm-logplayer", "klab calibrate --robot-name"),
)
"""Beginnings of the lines that are for this file."""
ALIKE = {
    "klab up --view": "with --port, above",
    f"klab view --url {REPLAYS} --port 8766": "tests/browser opens a replay's page",
    "klab replay runs/there": "as the other replay, above",
    "klab run onboard --config runs/robot.yaml": "the file is read by test_first_hour",
    "klab topics --config runs/robot.yaml": "the file is read by test_first_hour",
}
"""Lines that say again, on another file or another port, what a line run here says."""


def test_each_such_line_is_run_here():
    source = Path(__file__).read_text().partition("SHOWN_BY = ")[0]
    for words in LINES:
        line = " ".join(words)
        if line.startswith(SHOWN_BY) and line not in ALIKE:
            told = line.replace(REPLAYS, '"{REPLAYS}"')
            assert told in source, f"README: `{line}` is run by nothing; run it here"

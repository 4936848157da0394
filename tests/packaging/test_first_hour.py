"""The README's first hour, typed as a newcomer types it: each block on what those before it left.

What runs until Ctrl-C gets a terminal of its own. Buses and ports are the test's; parks begin near
the goal.
"""

import re
import shlex
import subprocess
import urllib.request
from pathlib import Path

import pytest
from checkout import checkout
from klab import ALONE, SHORT_RUNS, klab, klab_ok
from real_bus import Ear, other
from terminals import FIRST, HEREDOC, HOUR, LIMIT_S, REPLAYS, Terminal, run

from koopman_lab.bus.channels import CHANNELS
from koopman_lab.config.load import load_config
from offboard.commands.view import free_port

NEAR = ("--start", "-0.1", "0", "0")
DEMO = "./scripts/demo --lockstep --out runs/demo"
ELSEWHERE = {
    "in the first block, by a shell": (DEMO, "source .venv/bin/activate", "klab doctor"),
    "the bus is the test's": ("export LCM_DEFAULT_URL",),
    "would run this test within itself": ("./scripts/test",),
}
"""Lines that are not typed here one by one, under the reason."""


def is_alone(words: list[str]) -> bool:
    """Return whether a line needs no bus and no process beside it."""
    return words[0] == "klab" and (words[1] in ALONE or "--lockstep" in words)


def by_the_shell(text: str, cwd: Path) -> str:
    """Let a shell run a text, expect success, return what it printed."""
    done = subprocess.run(
        ["bash", "-euc", text], cwd=cwd, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, f"{text}\n{done.stdout}{done.stderr}"
    return done.stdout


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Let the first hour pass in a checkout; what needs a lab is left to the tests."""
    where = tmp_path_factory.mktemp("first-hour")
    programs = checkout(where)
    (programs / "activate").write_text(f"PATH={programs}:$PATH\n")
    block = re.search(r"^```bash\n(.*?)^```", HOUR, re.M | re.S).group(1)
    assert block.startswith(DEMO)
    assert "runs/demo" in by_the_shell(block, where)
    for name, text in HEREDOC.findall(HOUR):
        (where / name).write_text(text)
    for words in filter(is_alone, FIRST):
        done = klab(*words[1:], cwd=where)
        assert done.returncode == 0, f"{words}\n{done.stderr}"
    return where


@pytest.fixture
def ear(bus_url):
    return Ear(bus_url)


def test_every_block_leaves_what_it_promises(folder):
    for name in ("demo/model.npz", "mine.npz", "own.npz", "there/session-plot.png"):
        assert (folder / "runs" / name).exists(), name
    printed = klab_ok("model", "info", folder / "runs" / "own.npz")
    assert "sin(theta)" in printed
    config = (folder / "runs" / "own-cost" / "config.yaml").read_text()
    assert "20.0" in config


def test_the_demo_calibrates_trains_and_parks_in_real_time(folder):
    printed = by_the_shell(shlex.join(["./scripts/demo", "--segments", "4", *SHORT_RUNS]), folder)
    assert "camera messages lost" in printed


def test_the_page_and_a_first_park(folder, ear):
    with Terminal("klab up --view", folder, "--port", str(free_port())) as up:
        assert up.until("http://")
        ear.wait_for("plant", "onboard", "logger")
        line = (
            "klab park --model runs/demo/model.npz --set controller.parked_hold_s=60 "
            "--set controller.time_limit_s=300 --out runs/first-park"
        )
        run(line, folder, *NEAR, "--set", "controller.parked_hold_s=0.5")
        up.interrupt()
    assert (folder / "runs" / "first-park" / "summary.json").exists()


def test_it_is_played_again_to_a_page_of_its_own(folder, bus_url):
    bus, port = ("--url", other(bus_url)), str(free_port())
    with Terminal(f'klab view --url "{REPLAYS}" --port 8766', folder, *bus, "--port", port) as view:
        address = re.search(r"http://\S+?/", view.until("http://")).group()
        assert "STOP" in urllib.request.urlopen(address, timeout=LIMIT_S).read().decode()
        run("klab replay runs/there", folder, *bus, "--speed", "10")
        view.interrupt()


def test_two_machines(folder, ear):
    with (
        Terminal("klab run plant", folder) as plant,
        Terminal("klab run onboard --preset lab", folder) as board,
    ):
        assert board.until("preset lab: radio, clock and faults are simulated")
        ear.wait_for("plant", "onboard")
        ear.wait(lambda: ear.status is not None)
        assert "MOCAP_POSE" in run("klab topics --once", folder)
        run("klab park --model runs/demo/model.npz --out runs/two-machines", folder, *NEAR)
        plant.interrupt()
        board.interrupt()
    assert (folder / "runs" / "two-machines" / "summary.json").exists()


def test_a_robot_that_is_no_part_of_this_software(folder, ear):
    """Its motors, encoders, and cameras are those of the simulated one."""
    with (
        Terminal("klab run plant", folder) as plant,
        Terminal("klab run onboard --config runs/robot.yaml", folder) as board,
        Terminal("klab topics --config runs/robot.yaml", folder) as topics,
    ):
        assert board.until("runs/robot.yaml: nothing is simulated")
        ear.wait_for("plant", "onboard")
        ear.wait(lambda: ear.status is not None)
        assert topics.until("ENCODER")
        topics.interrupt()
        run("klab estop", folder)
        run("klab estop --release", folder)
        line = "klab calibrate --config runs/robot.yaml --preset real --out runs/real"
        run(line, folder, "--segments", "1", *SHORT_RUNS)
        plant.interrupt()
        board.interrupt()
    assert (folder / "runs" / "real" / "session.lcm").exists()


def test_the_file_of_a_real_robot_is_a_configuration(folder):
    config = load_config(folder / "runs" / "robot.yaml")
    assert (config.robot.name, config.robot.kind) == ("R1", "kinematic")


def test_the_steps_that_are_asked_for_are_there():
    told = re.sub(r"\s+", " ", HOUR)
    for word in ("klab doctor", "klab calibrate", "--goal", "klab replay", "--dictionary", "ttl=1"):
        assert word in told
    for name in ("MOTOR_CMD", "ENCODER", "MOCAP_POSE", "ONBOARD_STATUS", "ESTOP", "WHEEL_STATE"):
        assert name in {channel.suffix for channel in CHANNELS}
        assert f"`{name}`" in told


def test_each_line_is_run_here():
    source = Path(__file__).read_text().partition("def test_each_line_is_run_here")[0]
    source = re.sub(r'"\n\s*"', "", source)  # a long line stands in several pieces
    left = {line for lines in ELSEWHERE.values() for line in lines}
    for words in FIRST:
        line = " ".join(words)
        told = line.replace(REPLAYS, '"{REPLAYS}"')
        run_here = is_alone(words) or line.startswith(tuple(left)) or told in source
        assert run_here, f"README: nothing runs `{line}`"

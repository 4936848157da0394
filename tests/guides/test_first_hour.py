"""The first hour behind the README's ten minutes: each block on what those before it left.

What runs until Ctrl-C gets a terminal of its own. Buses and ports are the test's; parks begin near
the goal.
"""

import re
import shlex
import urllib.request

import pytest
from guide_pages.pages import REPLAYS, blocks, section
from guide_pages.terminals import LIMIT_S, Terminal, by_the_shell, run
from klab import SHORT_RUNS, klab_ok
from real_bus import Ear, other

from koopman_lab.bus.channels import CHANNELS
from koopman_lab.config.load import load_config
from offboard.commands.view import free_port

NEAR = ("--start", "-0.1", "0", "0")
DEMO = "./scripts/demo --lockstep --out runs/demo\n"
TEN_MINUTES = section("README.md", "Ten minutes")
HOUR = TEN_MINUTES + section("offboard/README.md", "A first hour")
ROBOT = section("onboard/README.md", "A real robot")


@pytest.fixture
def ear(bus_url):
    return Ear(bus_url)


def test_the_first_block_leaves_a_model_and_a_shell_that_knows_klab(guides):
    folder = guides.with_left("runs/demo")
    assert (folder / "runs" / "demo" / "model.npz").exists()
    typed = blocks(TEN_MINUTES)[0].text
    assert typed.startswith(DEMO)
    assert "multicast" in by_the_shell(typed.removeprefix(DEMO), folder)


def test_the_other_blocks_leave_what_they_promise(guides):
    folder = guides.with_left("runs/mine.npz", "runs/own.npz", "runs/own-cost")
    guides.with_typed("klab log plot runs/there")
    assert (folder / "runs" / "there" / "session-plot.png").exists()
    printed = klab_ok("model", "info", folder / "runs" / "own.npz")
    assert "sin(theta)" in printed
    config = (folder / "runs" / "own-cost" / "config.yaml").read_text()
    assert "20.0" in config


def test_the_demo_calibrates_trains_and_parks_in_real_time(guides):
    printed = by_the_shell(
        shlex.join(["./scripts/demo", "--segments", "4", *SHORT_RUNS]), guides.checkout
    )
    assert "camera messages lost" in printed


def test_it_is_played_again_to_a_page_of_its_own(guides, bus_url):
    folder = guides.with_left("runs/there")
    bus, port = ("--url", other(bus_url)), str(free_port())
    with Terminal(f'klab view --url "{REPLAYS}" --port 8766', folder, *bus, "--port", port) as view:
        address = re.search(r"http://\S+?/", view.until("http://")).group()
        assert "STOP" in urllib.request.urlopen(address, timeout=LIMIT_S).read().decode()
        run("klab replay runs/there", folder, *bus, "--speed", "10")
        view.interrupt()


def test_two_machines(guides, ear):
    folder = guides.with_left("runs/demo/model.npz")
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


def test_a_robot_that_is_no_part_of_this_software(guides, ear):
    """Its motors, encoders, and cameras are those of the simulated one."""
    folder = guides.checkout
    with (
        Terminal("klab run plant", folder) as plant,
        Terminal("klab run onboard --config runs/robot.yaml", folder) as board,
        Terminal("klab topics --config runs/robot.yaml", folder) as topics,
    ):
        assert board.until("runs/robot.yaml: nothing is simulated")
        ear.wait_for("plant", "onboard")
        ear.wait(lambda: ear.status is not None)
        assert topics.until("ENCODER")
        topics.end()  # which it does by itself where nobody looks
        run("klab estop", folder)
        run("klab estop --release", folder)
        line = "klab calibrate --config runs/robot.yaml --preset real --out runs/real"
        # Longer than what is discarded of a run: without a sample the session is not complete.
        longer = ("--set", "sampler.largest_steps=40")
        run(line, folder, "--segments", "1", *SHORT_RUNS, *longer)
        plant.interrupt()
        board.interrupt()
    assert (folder / "runs" / "real" / "session.lcm").exists()


def test_the_file_of_a_real_robot_is_a_configuration(guides):
    config = load_config(guides.checkout / "runs" / "robot.yaml")
    assert (config.robot.name, config.robot.kind) == ("R1", "kinematic")


def test_the_steps_that_are_asked_for_are_there():
    told = re.sub(r"\s+", " ", HOUR)
    for word in ("klab doctor", "klab calibrate", "--goal", "klab replay", "--dictionary"):
        assert word in told
    for name in ("MOTOR_CMD", "ENCODER", "MOCAP_POSE", "ONBOARD_STATUS", "ESTOP", "WHEEL_STATE"):
        assert name in {channel.suffix for channel in CHANNELS}
        assert f"`{name}`" in ROBOT

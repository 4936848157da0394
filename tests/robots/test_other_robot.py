"""A robot of another package: its file, its channel, and what says in words that it cannot."""

import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import lcm
import pytest
from klab import KLAB, environment
from plugin_package import install

from koopman_lab.bus import channels
from koopman_lab.config.load import load_config
from koopman_lab.errors import ConfigError, PluginError, UsageError
from koopman_lab.robots.command_message import CommandMessage
from koopman_lab.robots.kinematic import KINEMATIC
from koopman_lab.robots.table import ROBOTS
from offboard.desk.commander import Commands
from offboard.reference.shapes import Shape, input_sequence
from offboard.sampler.node import SamplerNode
from onboard.motor_loop.command_arbiter import Command, Intent
from onboard.motor_loop.node import OnboardNode

STRUCT = """package omni_types;
struct omni_command_t
{
    int64_t utime;
    int64_t sequence;
    int32_t commander;
    const int8_t CONTINUE = 0, BEGIN = 1, RELEASE = 2;
    int8_t intent;
    double velocity[3];
    double ahead_m_per_s;
    double aside_m_per_s;
    double omega_rad_per_s;
}
"""
MODULE = """
from pathlib import Path
import numpy as np
from koopman_lab.robots.robot_type import Quantity, RobotType

def roll(x, u, dt_s, m):
    half = x[2] + 0.5 * dt_s * u[2]
    c, s = m.cos(half), m.sin(half)
    return [x[0] + dt_s * (c * u[0] - s * u[1]), x[1] + dt_s * (s * u[0] + c * u[1]),
            x[2] + dt_s * u[2]]

def stand(x, u_max, dt_s, steps):
    return np.zeros((steps, 3))

OMNI = RobotType(
    "omni", "omnidirectional robot",
    (Quantity("x1", "m"), Quantity("x2", "m"), Quantity("theta", "rad")),
    (Quantity("ahead", "m/s"), Quantity("aside", "m/s"), Quantity("omega", "rad/s")),
    roll, False, (), (), stand, np.ones, defaults=Path(__file__).with_name("omni.yaml"),
)
"""
DEFAULTS = """
placement: {position_m: 0.0, angle_rad: 0.0}
sampler:
  segments_per_basis: 3
  basis_inputs: [[0.2, 0.0, 0.0], [0.0, 0.2, 0.0], [0.0, 0.0, 0.5]]
  admissible_set:
    {x1_m: [-1, 1], x2_m: [-1, 1], theta_rad: [-4, 4], v_m_per_s: [-1, 1], omega_rad_per_s: [-1, 1]}
processing: {discard_start_s: 0.1}
model: {dictionary: "1, x1, x2, cos(theta), sin(theta)"}
controller:
  horizon: 30
  u_max: [0.4, 0.4, 1.5]
  weights: {me: {q: [1, 1, 0.1], r: [0.1, 0.1, 0.01]}}
presets:
  ideal: {simulation: {plant: {motor: {drive: instantaneous}}}}
"""
OWN = ("ahead_m_per_s", "aside_m_per_s", "omega_rad_per_s")


@pytest.fixture
def package(tmp_path):
    """Install a package with one robot, whose file of defaults lies beside it."""
    rows = {"koopman_lab.robots": {"omni": "omni_robot:OMNI"}}
    folder = install(tmp_path / "stranger", rows, {"omni_robot": MODULE})
    (folder / "omni.yaml").write_text(DEFAULTS)
    return folder


@pytest.fixture
def omni(package):
    """Add the robot to this process."""
    scope = {"__file__": str(package / "omni_robot.py")}
    exec(MODULE, scope)
    robot = scope["OMNI"]
    ROBOTS.register(robot.name, robot)
    yield robot
    ROBOTS.unregister(robot.name)


def with_command(robot, suffix, message, fields=OWN):
    changed = replace(robot, command=CommandMessage(suffix, message, fields))
    ROBOTS.unregister(robot.name)
    ROBOTS.register(robot.name, changed)
    return changed


@pytest.fixture
def message(tmp_path, monkeypatch):
    """Make the type of its command, as its author does."""
    file = tmp_path / "omni_command_t.lcm"
    file.write_text(STRUCT)
    generator = Path(lcm.LCM_BIN_DIR) / "lcm-gen"
    subprocess.run([generator, "--python", "--ppath", tmp_path, file], check=True)
    monkeypatch.syspath_prepend(str(tmp_path))
    from omni_types import omni_command_t

    yield omni_command_t
    del sys.modules["omni_types"]


class Wire:
    """A port that keeps what is sent."""

    robot_name, virtual, process = "R1", True, 0

    def __init__(self):
        self.sent = []

    def publish(self, channel, message):
        self.sent.append((channel.name(self.robot_name), message))

    def subscribe(self, channel, handler):
        pass

    def now_us(self):
        return 0


@pytest.mark.usefixtures("omni")
def test_it_brings_its_own_defaults():
    config = load_config(robot="omni", overrides=["controller.horizon=7"])
    assert (config.controller.horizon, config.controller.u_max) == (7, (0.4, 0.4, 1.5))
    assert config.sampler.indexed_inputs[3] == (0.0, 0.0, 0.5)
    assert config.simulation.plant.motor.drive == "dc"
    ideal = load_config(robot="omni", preset="ideal")
    assert ideal.simulation.plant.motor.drive == "instantaneous"
    assert config.robot.kind == "omni"


@pytest.mark.usefixtures("omni")
@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("controller: {horizont: 3}", "omni.yaml:1: controller.horizont: unknown key; did you"),
        ("presets: {ideal: 3}", "omni.yaml:1: presets.ideal: expected sections"),
        ("plant: {motor: {gain: [1, 1]}}", "omni.yaml:1: plant.motor.gain: is now simulation."),
        ("presets: 3", "omni.yaml:1: presets.ideal: expected sections"),
        ("- 1", "omni.yaml:1: expected sections"),
        ("a: [", "omni.yaml:2: not valid YAML"),
        (None, "the defaults of the omni robot cannot be read"),
    ],
)
def test_a_mistake_in_its_defaults_is_named_with_its_place(package, text, reason):
    (package / "omni.yaml").unlink()
    if text is not None:
        (package / "omni.yaml").write_text(text)
    with pytest.raises(ConfigError) as error:
        load_config(robot="omni", preset="ideal")
    assert reason in str(error.value)


def test_its_commands_go_out_on_a_channel_of_its_own(omni, message):
    robot, wire = with_command(omni, "OMNI_CMD", message), Wire()
    (channel,) = [c for c in channels.all_channels() if c not in channels.CHANNELS]
    assert channels.split_name("R7_OMNI_CMD") == ("R7", channel)
    assert channel not in channels.wheel_command_channels()
    commands = Commands(wire, load_config(robot="omni"), "controller")
    commands.send((0.1, -0.2, 0.3), 5)
    commands.release(6)
    (name, first), (_, last) = wire.sent[-2:]
    assert name == "R1_OMNI_CMD"
    received = message.decode(first.encode())
    assert (received.utime, received.intent) == (5, message.BEGIN)
    assert robot.command.decode(received) == (0.1, -0.2, 0.3)
    assert (robot.command.decode(last), last.intent) == ((0.0, 0.0, 0.0), message.RELEASE)


def test_a_channel_that_carries_another_message_is_refused(omni, message):
    robot = with_command(omni, "MOCAP_POSE", message)
    with pytest.raises(PluginError, match="MOCAP_POSE carries mocap_pose_t already, not omni_comm"):
        channels.command_channel(robot)
    assert channels.all_channels() == channels.CHANNELS


@pytest.mark.usefixtures("omni")
def test_without_a_message_nobody_commands_it():
    with pytest.raises(UsageError, match=r"omni robot has no command message.*klab simulate"):
        Commands(Wire(), load_config(robot="omni"), "controller")


@pytest.mark.usefixtures("omni")
@pytest.mark.parametrize(
    "build",
    [OnboardNode, SamplerNode, lambda config: input_sequence(config, Shape.SQUARE)],
    ids=["motor loop", "sampler", "reference driver"],
)
def test_what_moves_two_wheels_refuses_it_in_words(build):
    with pytest.raises(UsageError, match="on two driven wheels, the omni robot is none"):
        build(load_config(robot="omni"))


def test_another_robot_on_two_wheels_shares_channel_and_motor_loop():
    ROBOTS.register("slow", replace(KINEMATIC, name="slow"))
    try:
        assert load_config(robot="slow").robot.kind == "slow"
        node = OnboardNode(load_config(robot="slow"))
        assert channels.all_channels() == channels.CHANNELS
        node.loop.command(Command(0, 0, 1, Intent.BEGIN, 0.2, 0.0), 0)
        node.loop.tick(0)
        assert node.loop.setpoint.v > 0.0
    finally:
        ROBOTS.unregister("slow")


def klab_beside(package, *arguments, cwd):
    """Run ``klab`` where the package is installed."""
    return subprocess.run(
        [*KLAB, *arguments],
        env=environment(PYTHONPATH=str(package)),
        cwd=cwd,
        capture_output=True,
        text=True,
        check=False,
    )


REFUSED = "moves robots on two driven wheels, the omni robot is none"
KNOWN = "unknown robot 'omnii', known: kinematic, dynamic, omni; did you mean omni?"


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        (("run", "onboard", "--robot", "omni"), REFUSED),
        (("calibrate", "--lockstep", "--robot", "omni"), REFUSED),
        (("calibrate", "--robot", "omni"), REFUSED),
        (("demo", "--lockstep", "--robot", "omni"), REFUSED),
        (("reference", "--shape", "square", "--lockstep", "--robot", "omni"), REFUSED),
        (("up", "--robot", "omni"), REFUSED),
        (("run", "onboard", "--robot", "omnii"), KNOWN),
        (("run", "onboard", "--set", "robot.kind=omnii"), KNOWN),
    ],
)
def test_klab_says_in_one_message_what_it_cannot_do_with_it(package, tmp_path, arguments, reason):
    place = tmp_path / "empty"
    place.mkdir()
    done = klab_beside(package, *arguments, cwd=place)
    assert done.returncode == 2, done.stderr
    assert reason in done.stderr
    assert done.stderr.count("klab: ") == 1
    assert "Traceback" not in done.stderr
    assert list(place.iterdir()) == []


def test_help_lists_it_without_importing_it(package, tmp_path):
    (package / "omni_robot.py").write_text("raise RuntimeError('no wheels')")
    asked = klab_beside(package, "run", "onboard", "--help", cwd=tmp_path)
    assert "<kinematic|dynamic|omni>" in asked.stdout


def test_a_robot_that_cannot_be_imported_stops_only_whoever_wants_it(package, tmp_path):
    (package / "omni_robot.py").write_text("raise RuntimeError('no wheels')")
    asked = klab_beside(package, "run", "onboard", "--robot", "omni", cwd=tmp_path)
    assert asked.returncode == 2
    assert "robot 'omni' of the package klab-stranger" in asked.stderr
    assert "RuntimeError: no wheels" in asked.stderr
    out = tmp_path / "session"
    other = klab_beside(
        package, "calibrate", "--lockstep", "--segments", "1", "--out", str(out), cwd=tmp_path
    )
    assert (out / "session.lcm").exists()
    assert "Traceback" not in other.stderr

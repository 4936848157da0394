"""`klab estop` goes out before anything is loaded that its first message does not need."""

import subprocess
import sys
from pathlib import Path

import pytest
from klab import environment

from koopman_lab.config.load import load_config
from offboard.cli.main import command_line
from offboard.cli.stop_at_once import FLAGS, REPEATED, SECONDS, VALUES, Order, addresses, parse
from offboard.terminal import options

NOT_NEEDED = {
    *("typer", "click", "rich", "pydantic", "pydantic_core", "numpy", "scipy", "casadi"),
    *("importlib.metadata", "packaging", "email", "json", "asyncio"),
    *("koopman_lab.config.schema", "koopman_lab.config.load", "koopman_lab.koopman"),
    *("offboard.cli.main", "offboard.terminal.options", "offboard.desk.guard"),
}
FIRST_MESSAGE = """
import sys
sys.argv = ["klab", "estop", *sys.argv[1:]]
from offboard.cli.start import main
from koopman_lab.bus.realtime_port import RealtimePort

send = RealtimePort.send

def noted(port, name, data):
    send(port, name, data)
    print(name, port.bus is not None, *sorted(sys.modules))
    sys.stdout.flush()
    raise KeyboardInterrupt

RealtimePort.send = noted
main()
"""
CASES = [
    [],
    ["--robot-name", "R7"],
    ["--robot-name=R7", "--url=udpm://239.255.76.68:7001?ttl=0"],
    ["--set", "robot.name=R8", "--set", "bus.url=udpm://239.255.76.68:7002?ttl=0"],
    ["--set", "robot.kind=dynamic", "--robot-name", "R9"],
    ["--set", "bus.key_file=lab.key"],
    ["--config", "lab.yaml"],
    ["--config", "lab.yaml", "--robot-name", "R3", "--set", "controller.horizon=20"],
    ["--all", "--release", "--config=lab.yaml"],
]


def first_message(*arguments):
    done = subprocess.run(
        [sys.executable, "-c", FIRST_MESSAGE, *arguments],
        env=environment(),
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 130, done.stderr
    name, is_open, *modules = done.stdout.split()
    return name, is_open, set(modules)


@pytest.mark.parametrize("arguments", [[], ["--all"]])
def test_nothing_is_loaded_that_the_first_message_does_not_need(arguments):
    name, is_open, modules = first_message(*arguments)
    assert (name, is_open) == ("R1_ESTOP", "True")
    assert not {m for m in modules if m in NOT_NEEDED or m.split(".")[0] in NOT_NEEDED}


def test_priority_is_asked_for_before_all_else():
    code = (
        "import os, sys\n"
        "def asked(*_):\n"
        "    print(*sorted(sys.modules))\n"
        "    raise KeyboardInterrupt\n"
        "os.sched_setscheduler = asked\n"
        "sys.argv = ['klab', 'estop']\n"
        "from offboard.cli.start import main\n"
        "main()\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], env=environment(), capture_output=True, text=True, check=False
    )
    assert done.returncode == 130, done.stderr
    ours = {m for m in done.stdout.split() if m.split(".")[0] in ("koopman_lab", "offboard", "lcm")}
    packages = {"koopman_lab", "koopman_lab.bus", "offboard", "offboard.cli"}
    assert ours == packages | {"koopman_lab.bus.priority", "offboard.cli.start"}


@pytest.mark.parametrize("arguments", CASES, ids=" ".join)
def test_robot_and_bus_are_those_of_the_command_line(arguments, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "lab.yaml").write_text(
        "robot: {kind: dynamic, name: R2}\nbus: {url: 'udpm://239.255.76.69:7003?ttl=0'}\n"
    )
    order = parse(arguments)
    lab = addresses(order)
    whole = options.resolve(
        order.config and Path(order.config),
        order.overrides,
        None,
        url=order.url,
        robot_name=order.robot_name,
    )
    assert lab.robot.name == whole.robot.name
    for key in ("url", "receive_buffer_bytes", "heartbeat_rate_hz", "key_file"):
        assert getattr(lab.bus, key) == getattr(whole.bus, key)
    assert order.all_robots == ("--all" in arguments)
    assert order.release == ("--release" in arguments)


def test_every_option_of_the_command_is_known_and_no_other():
    command = command_line().commands["estop"]
    known = {o for parameter in command.params for o in parameter.opts}
    assert known - {"--help", "-h"} == {*FLAGS, *VALUES, *SECONDS, *REPEATED}
    names = {p.name for p in command.params} - {"help"}
    assert names == set(Order._fields)


@pytest.mark.parametrize(
    "arguments",
    [
        ["--help"],
        ["R1"],
        ["--config"],
        ["--release=1"],
        ["--all", "--robot-name", "R2"],
        ["--unknown", "1"],
        ["--limit-s", "0"],
        ["--limit-s", "nan"],
        ["--limit-s=soon"],
    ],
    ids=" ".join,
)
def test_what_is_not_understood_is_left_to_the_command_line(arguments):
    assert parse(arguments) is None


@pytest.mark.parametrize(
    "text", ["robot: [", "robot: 3", "bus: {url: 3}", "robot: {kind: no_such_robot}"]
)
def test_a_configuration_without_addresses_is_left_to_the_command_line(text, tmp_path):
    (tmp_path / "lab.yaml").write_text(text)
    assert addresses(Order(config=str(tmp_path / "lab.yaml"))) is None
    assert addresses(Order(config=str(tmp_path / "missing.yaml"))) is None


def test_a_mistake_elsewhere_in_the_configuration_stops_nobody_from_stopping(tmp_path):
    (tmp_path / "lab.yaml").write_text("robot: {name: R4}\ncontroller: {horizon: -3}\n")
    assert addresses(Order(config=str(tmp_path / "lab.yaml"))).robot.name == "R4"
    assert load_config().robot.name == "R1"

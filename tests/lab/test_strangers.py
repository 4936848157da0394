"""What a stranger on the bus can do to a robot, where the lab has a key and where it has none.

Real processes over real UDP; whether the robot moves is the plant's truth. Without a key all of it
works, as `klab doctor` says.
"""

import os
import socket
import subprocess
import sys

import pytest
from klab import alive
from real_bus import HOLDER, STATUS, StrangersLab, commands

import lcmtypes
from koopman_lab.bus import channels
from koopman_lab.units import US_PER_S
from offboard.terminal.exit_codes import ExitCode

MOVED_M = 0.02
"""Nobody can call that noise: the plant's truth of a robot that stands does not change at all."""


@pytest.fixture
def lab(bus_url, key_options):
    lab = StrangersLab(bus_url, key_options)
    lab.has_key = bool(key_options)
    try:
        yield lab
    finally:
        lab.close()


def duties(lab):
    def make(_):
        message = lcmtypes.motor_command_t()
        message.utime, message.left_duty, message.right_duty = lab.holder.now_us(), 0.5, 0.5
        return message

    return make


def test_motor_duties_of_a_stranger(lab):
    lab.start_robot()
    lab.say((lab.stranger, channels.MOTOR_CMD, duties(lab)))
    assert (lab.moved_m() < MOVED_M) == lab.has_key
    if lab.has_key:
        assert lab.moved_m() == 0.0


def test_commands_with_the_number_of_who_holds_the_robot(lab):
    """The holder lets the robot stand; the stranger has heard its number on the bus."""
    lab.start_robot()
    lab.say(
        (lab.holder, channels.VELOCITY_CMD, commands(lab, 0.0)),
        (lab.stranger, channels.VELOCITY_CMD, commands(lab, 0.3)),
    )
    assert (lab.moved_m() == 0.0) == lab.has_key
    assert lab.status.accepted > 0  # the holder's
    if lab.has_key:
        assert lab.status.commander == HOLDER


@pytest.mark.parametrize("knows_the_stop", [False, True])
def test_a_release_by_a_stranger_whose_clock_is_an_hour_ahead(lab, knows_the_stop):
    lab.start_robot()
    done = lab.klab("estop")
    assert done.returncode == 0, done.stderr
    lab.wait(lambda: lab.status.state == STATUS.ESTOP)

    def release(_):
        message = lcmtypes.estop_t()
        message.utime = lab.holder.now_us() + 3600 * US_PER_S
        message.stop_number = lab.status.stop_number if knows_the_stop else 0
        return message

    lab.say((lab.stranger, channels.ESTOP, release))
    assert (lab.status.state == STATUS.ESTOP) == lab.has_key
    done = lab.klab("estop", "--release")
    assert done.returncode == 0, done.stderr


def test_a_stop_by_a_stranger(lab):
    """Whoever sees a robot drive at somebody may stop it."""
    lab.start_robot()

    def stop(_):
        message = lcmtypes.estop_t()
        message.utime, message.engaged = lab.holder.now_us(), True
        return message

    lab.say((lab.stranger, channels.ESTOP, stop))
    lab.wait(lambda: lab.status.state == STATUS.ESTOP)
    done = lab.klab("estop", "--release")
    assert done.returncode == 0, done.stderr


def test_a_forged_status_makes_nobody_believe_that_a_robot_stopped(lab):
    """Nobody is there to obey; a stranger says that it has stopped."""
    speaking = subprocess.Popen(
        [sys.executable, "-c", FORGED_STATUS], stdin=subprocess.PIPE, env=os.environ
    )
    try:
        done = lab.klab("estop", "--limit-s", "2")
    finally:
        speaking.stdin.close()
        speaking.wait(60)
    if lab.has_key:
        assert done.returncode == ExitCode.LAB_FAILURE
        assert "R1_ONBOARD_STATUS is silent" in done.stderr
        assert "without the lab's key" in done.stderr
    else:
        assert done.returncode == 0
        assert "stopped" in done.stderr


FORGED_STATUS = """
import select, sys
import lcmtypes
from koopman_lab.bus.channels import ONBOARD_STATUS
from koopman_lab.bus.realtime import Listener
from koopman_lab.config.load import load_config
import os
speaker = Listener(load_config(bus_url=os.environ["LCM_DEFAULT_URL"]))
while not select.select([sys.stdin], (), (), 0.02)[0]:
    status = lcmtypes.onboard_status_t()
    status.utime, status.state, status.stop_number = speaker.now_us(), status.ESTOP, 1
    speaker.publish(ONBOARD_STATUS, status)
"""


def test_a_process_number_of_a_stranger_is_interrupted_by_nobody(lab, tmp_path, monkeypatch):
    """It even calls itself klab; its number is said on the bus as that of a lab's command."""
    monkeypatch.setenv("KOOPMAN_LAB_CACHE", str(tmp_path / "cache"))
    lab.start_robot()
    victim = subprocess.Popen([sys.executable, "-c", "input()", "klab"], stdin=subprocess.PIPE)
    speaking = subprocess.Popen(
        [sys.executable, "-c", FORGED_PROCESS, str(victim.pid), socket.gethostname()],
        stdin=subprocess.PIPE,
    )
    try:
        done = lab.klab("down")
        assert done.returncode == ExitCode.LAB_FAILURE
        assert victim.poll() is None
        assert all(alive(process.pid) for process in lab.processes)
    finally:
        for process in (speaking, victim):
            process.stdin.close()
            process.wait(60)


FORGED_PROCESS = """
import os, select, sys
import lcmtypes
from koopman_lab.bus.channels import PROCESS
from koopman_lab.bus.realtime import Listener
from koopman_lab.config.load import load_config
speaker = Listener(load_config(bus_url=os.environ["LCM_DEFAULT_URL"]))
while not select.select([sys.stdin], (), (), 0.05)[0]:
    for name in ("controller", "onboard"):
        report = lcmtypes.process_t()
        report.utime, report.name, report.state = speaker.now_us(), name, report.RUNNING
        report.pid = report.supervisor_pid = int(sys.argv[1])
        report.host = sys.argv[2]
        speaker.publish(PROCESS, report)
"""


@pytest.mark.parametrize("key_options", ["key"], indirect=True)
def test_a_stop_needs_no_key_that_can_be_used(lab, tmp_path):
    """Whoever stops a robot is not to mend a file first; he is told that it is broken."""
    lab.start_robot()
    (tmp_path / "lab.key").chmod(0o644)
    done = lab.klab("estop")
    assert done.returncode == 0
    assert "chmod 600" in done.stderr.replace("\n", " ")
    assert "stopped" in done.stderr
    lab.wait(lambda: lab.status.state == STATUS.ESTOP)
    assert lab.klab("estop", "--release").returncode == 2
    (tmp_path / "lab.key").chmod(0o600)
    done = lab.klab("estop", "--release")
    assert done.returncode == 0, done.stderr


def test_what_a_stranger_says_is_named(lab):
    lab.start_robot()
    speaking = subprocess.Popen(
        [sys.executable, "-c", FORGED_STATUS], stdin=subprocess.PIPE, env=os.environ
    )
    try:
        topics, status = lab.klab("topics", "--once"), lab.klab("status")
    finally:
        speaking.stdin.close()
        speaking.wait(60)
    for said in (topics.stderr, status.stderr):
        assert ("messages without the lab's key" in said) == lab.has_key
        if lab.has_key:
            assert "R1_ONBOARD_STATUS (" in said

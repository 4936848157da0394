"""What a stranger on the bus can do to a robot, where the lab has a key and where it has none.

Real processes over real UDP; whether the robot moves is the plant's truth. Without a key all of it
works, as `klab doctor` says.
"""

import os
import socket
import subprocess
import sys

import lcm
import pytest
from klab import SHORT_RUNS, alive, klab, start_klab
from real_bus import recorded, tool

import lcmtypes
from koopman_lab.bus import channels
from koopman_lab.bus.authentication import Verdict, Verifier
from koopman_lab.bus.commanders import commander_number
from koopman_lab.bus.lab_key import read_key, write_new_key
from koopman_lab.bus.realtime import Listener
from koopman_lab.config.load import load_config
from koopman_lab.data.decode import SessionLog
from koopman_lab.units import US_PER_S

STATUS = lcmtypes.onboard_status_t
WAIT_S = 0.01
MOVED_M = 0.02
"""Nobody can call that noise: the plant's truth of a robot that stands does not change at all."""
SENDINGS = 150
"""Of a hundred messages a second."""
PID, MANY = 4711, 1_000_000
KEYS = ("key", "no key")


class Stranger:
    """A program on the bus that has LCM and the types of messages, and no key."""

    def __init__(self, url):
        self._bus = lcm.LCM(url)

    def publish(self, channel, message):
        """Send a message as it is, with whatever number."""
        self._bus.publish(channel.name("R1"), message.encode())


class Lab:
    """A robot whose processes have the key or none, a witness of its truth, and a stranger."""

    def __init__(self, url, options):
        self.options = options
        overrides = [word for word in options if word != "--set"]
        config = load_config(overrides=[f"bus.url={url}", *overrides])
        self.holder = Listener(config)
        """Speaks with the key, if there is one."""
        self.stranger = Stranger(url)
        self.status = None
        self.poses = []
        self.holder.subscribe(channels.ONBOARD_STATUS, self._on_status)
        self.holder.subscribe(channels.PLANT_TRUTH, self._on_truth)
        self._truth_us = 0
        self.processes = []

    def _on_status(self, status):
        self.status = status

    def _on_truth(self, truth):
        if truth.utime > self._truth_us:  # what a log said of it was true then
            self._truth_us = truth.utime
            self.poses.append((truth.x1_m, truth.x2_m))

    def start(self, *names):
        self.processes += [
            start_klab("run", name, "--preset", "lab", *self.options) for name in names
        ]

    def start_robot(self):
        self.start("plant", "onboard")
        self.wait(lambda: self.poses and self.status and self.status.state == STATUS.REST)

    def wait(self, condition):
        for _ in range(6000):
            if condition():
                return
            self.holder.spin(WAIT_S)
        pytest.fail("did not happen in time")

    def say(self, *messages):
        """Have each message, made anew, said so often while the robot is watched."""
        for k in range(SENDINGS):
            for speaker, channel, make in messages:
                message = make(k)
                speaker.publish(channel, message)
            self.watch(WAIT_S)

    def watch(self, seconds):
        end_us = self.holder.now_us() + seconds * US_PER_S
        while (left_us := end_us - self.holder.now_us()) > 0:
            self.holder.spin(left_us / US_PER_S)

    def moved_m(self):
        x1, x2 = self.poses[0]
        return max(((x - x1) ** 2 + (y - x2) ** 2) ** 0.5 for x, y in self.poses)

    def klab(self, *words):
        return klab(*words, *self.options)

    def close(self):
        for process in self.processes:
            process.terminate()
            process.communicate(timeout=60)


@pytest.fixture
def lab_key(tmp_path):
    write_new_key(tmp_path / "lab.key")
    return tmp_path / "lab.key"


@pytest.fixture(params=KEYS)
def lab(request, bus_url, lab_key):
    options = ("--set", f"bus.key_file={lab_key}") if request.param == "key" else ()
    lab = Lab(bus_url, options)
    lab.has_key = request.param == "key"
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


HOLDER = commander_number("controller", PID)


def commands(lab, speed):
    """Return commands of the holder's number; a stranger counts on ahead of the holder."""

    def make(k):
        message = lcmtypes.velocity_command_t()
        message.utime, message.commander = lab.holder.now_us(), HOLDER
        is_held = lab.status.commander == HOLDER
        message.intent = message.CONTINUE if is_held else message.BEGIN
        message.v_m_per_s, message.sequence = speed, MANY + k  # of the holder's its port counts
        return message

    return make


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


def test_a_forged_status_makes_nobody_believe_that_a_robot_stopped(lab):
    """Nobody is there to obey; a stranger says that it has stopped."""
    speaking = subprocess.Popen(
        [sys.executable, "-c", FORGED_STATUS], stdin=subprocess.PIPE, env=os.environ
    )
    try:
        done = lab.klab("estop")
    finally:
        speaking.stdin.close()
        speaking.wait(60)
    if lab.has_key:
        assert done.returncode == 2
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
        assert done.returncode == 2
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


def test_a_stop_needs_no_key_that_can_be_used(bus_url, lab_key):
    """Whoever stops a robot is not to mend a file first; he is told that it is broken."""
    lab = Lab(bus_url, ("--set", f"bus.key_file={lab_key}"))
    try:
        lab.start_robot()
        lab_key.chmod(0o644)
        done = lab.klab("estop")
        assert done.returncode == 0
        assert "chmod 600" in done.stderr.replace("\n", " ")
        assert "stopped" in done.stderr
        lab.wait(lambda: lab.status.state == STATUS.ESTOP)
        assert lab.klab("estop", "--release").returncode == 2
    finally:
        lab.close()


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


@pytest.mark.parametrize("starts_anew", [False, True])
def test_a_log_of_signed_messages_sent_again_moves_nobody(bus_url, lab_key, tmp_path, starts_anew):
    """By lcm-logplayer: to those who heard it first, and to a robot that was started since."""
    lab, log = Lab(bus_url, ("--set", f"bus.key_file={lab_key}")), tmp_path / "session.lcm"
    url = ("--lcm-url", bus_url)
    logger = subprocess.Popen(
        [tool("lcm-logger"), "--quiet", *url, str(log)], stderr=subprocess.DEVNULL
    )
    try:
        lab.start_robot()
        lab.say((lab.holder, channels.VELOCITY_CMD, commands(lab, 0.3)))
        assert lab.moved_m() > MOVED_M
        logger.terminate()
        assert logger.wait(60) == 0
        if starts_anew:
            lab.close()
            lab.processes.clear()
            lab.status = None
            lab.poses.clear()
            lab.start_robot()
        else:
            lab.wait(
                lambda: lab.status.state != STATUS.DRIVING and not lab.status.v_setpoint_m_per_s
            )
            lab.watch(1.0)
        lab.poses.clear()
        lab.wait(lambda: lab.poses)
        player = subprocess.Popen([tool("lcm-logplayer"), *url, str(log)])
        lab.wait(lambda: player.poll() is not None)
        assert player.returncode == 0
        lab.watch(0.5)
        assert lab.moved_m() == 0.0
    finally:
        logger.kill()
        logger.wait()
        lab.close()


def test_a_whole_session_with_a_key_is_recorded_and_read_as_any(lab_key, tmp_path):
    """Cameras, counters, commands and status carry the tag; what is learned from them does not."""
    out, key = tmp_path / "calibration", ("--set", f"bus.key_file={lab_key}")
    done = klab("calibrate", "--segments", "2", *SHORT_RUNS, *key, "--out", out)
    assert done.returncode == 0, done.stderr
    messages = recorded(out / "session.lcm")
    for channel in channels.all_channels():
        for data in messages.get(channel.name("R1"), ())[:1]:
            tagged = Verifier(read_key(lab_key), channel.name("R1")).judge(data)
            is_protected = channel.protection != "never"
            assert tagged is (Verdict.VALID if is_protected else Verdict.UNSIGNED), channel
    log = SessionLog(out)
    assert log.channels["R1_MOCAP_POSE"].unreadable == 0
    assert log.channels["R1_VELOCITY_CMD"].count > 20
    done = klab("dataset", "make", out, "--out", tmp_path / "pairs.npz")
    assert done.returncode == 0, done.stderr
    done = klab("rerun", out, "--node", "sampler")
    assert done.returncode == 0, done.stdout + done.stderr

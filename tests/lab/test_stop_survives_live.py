"""A stop over real UDP: the program that holds it dies, or a second one is started beside it."""

import shlex
import signal
import subprocess
import sys

import pytest
from klab import klab, start_klab
from real_bus import Ear

import lcmtypes
from koopman_lab.bus.channels import MOTOR_CMD, PLANT_TRUTH
from koopman_lab.config.load import dump_config, load_config
from koopman_lab.files import STATE_VARIABLE
from offboard.bench.faults.stage import TruthSample, is_at_rest
from offboard.terminal.exit_codes import ExitCode

STATUS = lcmtypes.onboard_status_t
MESSAGES = 100
"""Motor commands of one second."""
STILL_M = 1e-3
WITHOUT_KEY = pytest.mark.parametrize("key_options", ["no key"], indirect=True)


ESTOP = [sys.executable, "-m", "offboard.cli.start", "estop"]


def estop(*arguments):
    """Run `klab estop` as its entry point does."""
    command = [*ESTOP, *arguments]
    return subprocess.run(command, capture_output=True, text=True, check=False, timeout=60)


class Board:
    """The programs of a robot, one by one, and somebody who drives it whenever it may."""

    def __init__(self, url, folder, options):
        self.options = options
        self.ear = Ear(url)
        self.duties, self.truths = [], []
        self.ear.listener.subscribe(MOTOR_CMD, self.duties.append)
        self.ear.listener.subscribe(PLANT_TRUTH, self.truths.append)
        self.running = []
        config = folder / "config.yaml"
        overrides = [f"bus.url={url}", *(word for word in options if word != "--set")]
        config.write_text(dump_config(load_config(overrides=overrides)))
        self.start("plant", *options)
        self.onboard = self.start_onboard()
        self.start("slalom", "--config", config)

    def start(self, *arguments):
        process = start_klab("run", *arguments)
        self.running.append(process)
        return process

    def start_onboard(self):
        return self.start("onboard", "--preset", "lab", *self.options)

    def kill(self, process):
        process.send_signal(signal.SIGKILL)
        process.communicate(timeout=60)
        self.running.remove(process)
        self.ear.status = None

    def wait_for(self, *states):
        self.ear.wait(lambda: self.ear.status is not None and self.ear.status.state in states)

    def wait_until_it_drives(self):
        self.wait_for(STATUS.DRIVING)
        self.ear.wait(lambda: abs(self.ear.status.v_setpoint_m_per_s) > 0.1)

    def require_still(self):
        """Let the robot brake, then watch a second of duties: none, and it stays where it is."""
        self.truths.clear()
        self.ear.wait(lambda: any(map(is_at_rest, map(TruthSample.of, self.truths[-5:]))))
        self.duties.clear()
        self.truths.clear()
        self.ear.wait(lambda: len(self.duties) >= MESSAGES and len(self.truths) >= MESSAGES)
        assert {(d.left_duty, d.right_duty) for d in self.duties} == {(0.0, 0.0)}
        for axis in ("x1_m", "x2_m"):
            places = [getattr(truth, axis) for truth in self.truths]
            assert max(places) - min(places) < STILL_M

    def end(self):
        for process in self.running:
            process.terminate()
            process.communicate(timeout=60)


@pytest.fixture
def board(bus_url, tmp_path, key_options):
    board = Board(bus_url, tmp_path, key_options)
    try:
        board.wait_until_it_drives()
        yield board
    finally:
        board.end()


def test_a_stop_outlasts_the_program_that_holds_it_and_its_release_ends_it(board):
    done = estop(*board.options)
    assert done.stderr == "stopped; `klab estop --release` releases it\n"
    board.wait_for(STATUS.ESTOP)
    number = board.ear.status.stop_number
    for _ in range(2):
        board.kill(board.onboard)
        board.onboard = board.start_onboard()
        board.wait_for(STATUS.ESTOP)
        assert board.ear.status.stop_number > number
        number = board.ear.status.stop_number
        board.require_still()
    assert estop("--release", *board.options).returncode == 0
    board.wait_until_it_drives()
    # Nothing is left of it: who dies now drives again.
    board.kill(board.onboard)
    board.onboard = board.start_onboard()
    board.wait_until_it_drives()


@pytest.mark.parametrize("arguments", [(), ("--all",)], ids=["one", "all"])
def test_a_stop_is_sent_until_the_robot_is_back_and_confirms_it(board, arguments):
    board.kill(board.onboard)
    command = [*ESTOP, *arguments, *board.options]
    stop = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)
    said = stop.stderr.readline()
    while "it is sent on until the robot confirms; Ctrl-C ends that" not in said:
        assert stop.poll() is None, said
        said += stop.stderr.readline()
    assert "R1" in said
    assert "is silent: the message was sent 100 times" in said
    board.onboard = board.start_onboard()
    _, said = stop.communicate(timeout=60)
    assert stop.returncode == 0, said
    assert "stopped" in said
    board.require_still()
    assert estop("--release", *board.options).returncode == 0


@pytest.mark.parametrize("ignored", [False, True], ids=["in front", "in the background"])
def test_a_stop_that_nobody_confirms_ends_where_a_person_ends_it(ignored):
    handler = signal.SIG_IGN if ignored else signal.SIG_DFL
    stop = subprocess.Popen(
        ESTOP,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, handler),
    )
    said = stop.stderr.readline()
    assert "R1_ONBOARD_STATUS is silent" in said
    stop.send_signal(signal.SIGINT)
    assert stop.communicate(timeout=60)[1] == "klab: interrupted\n"
    assert stop.returncode == ExitCode.INTERRUPTED
    done = estop("--limit-s", "0.1")
    assert done.returncode == ExitCode.LAB_FAILURE
    assert "was sent 5 times" in done.stderr


@pytest.mark.parametrize("redirection", ["2>&-", "2>/dev/full"])
def test_a_stop_is_sent_on_though_nobody_can_be_told(board, redirection):
    """The first words come after two seconds; the robot is there for the messages behind them."""
    board.kill(board.onboard)
    words = shlex.join([*ESTOP, *board.options])
    stop = subprocess.Popen(["sh", "-c", f"exec {words} {redirection}"])
    board.ear.listener.spin(3.0)
    assert stop.poll() is None
    board.onboard = board.start_onboard()
    board.wait_for(STATUS.ESTOP)
    assert stop.wait(60) == 0
    assert estop("--release", *board.options).returncode == 0


@WITHOUT_KEY
def test_where_no_stop_can_be_kept_a_start_is_a_stopped_start_in_words(
    board, tmp_path, monkeypatch
):
    blocked = tmp_path / "blocked"
    blocked.write_text("")
    board.kill(board.onboard)
    monkeypatch.setenv(STATE_VARIABLE, str(blocked))
    board.onboard = board.start_onboard()
    board.wait_for(STATUS.FAULT)
    assert board.ear.status.fault == STATUS.STOP_NOT_KEPT
    board.require_still()
    stop = estop()
    assert stop.returncode == ExitCode.LAB_FAILURE
    assert "cannot keep a stop over a restart" in " ".join(stop.stderr.split())
    assert estop("--release").returncode == 0
    board.wait_until_it_drives()
    board.onboard.terminate()
    said, _ = board.onboard.communicate(timeout=60)
    assert str(blocked) in said.replace("\n", "")


def test_a_second_program_on_the_same_board_is_refused_and_changes_nothing(board):
    second = klab("run", "onboard", "--preset", "lab", *board.options)
    assert second.returncode == ExitCode.LAB_FAILURE
    said = " ".join(second.stderr.split())
    assert f"process {board.onboard.pid} runs the onboard program of R1 already" in said
    board.wait_until_it_drives()


@WITHOUT_KEY
def test_a_second_board_elsewhere_stops_both_and_is_named(board, tmp_path, monkeypatch):
    monkeypatch.setenv(STATE_VARIABLE, str(tmp_path / "another board"))
    second = board.start_onboard()
    board.wait_for(STATUS.FAULT)
    assert board.ear.status.fault == STATUS.SECOND_LOOP
    board.require_still()
    status = klab("status")
    assert status.returncode == 1
    said = " ".join(status.stderr.split())
    assert "uses the name R1" in said or "second onboard program speaks for this robot" in said
    board.kill(second)
    board.require_still()
    assert estop("--release").returncode == 0
    board.wait_until_it_drives()

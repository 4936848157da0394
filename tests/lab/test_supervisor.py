"""What a supervisor says where the disk of the run folder takes nothing more."""

import os
import signal

import pytest

from koopman_lab.bus.channels import PROCESS
from koopman_lab.bus.realtime import Listener
from koopman_lab.config.load import load_config
from koopman_lab.errors import LabStateError, NotWrittenError
from offboard.lab import child_process
from offboard.lab.child_process import KILLED
from offboard.lab.run_folder import RunFolder
from offboard.lab.supervisor import supervised

MOST_WAITS = 600
WAIT_S = 0.05


@pytest.fixture
def lab(bus_url, tmp_path):
    config = load_config(overrides=[f"bus.url={bus_url}"])
    listener = Listener(config)
    with supervised(config, RunFolder(tmp_path), listener) as processes:
        yield processes, listener


def test_a_process_whose_file_cannot_be_written_is_not_started(lab, tmp_path):
    (tmp_path / "processes").write_text("in the way")
    with pytest.raises(NotWrittenError, match=r"logger\.log: cannot be written \(File exists\)"):
        lab[0].start("logger")


def test_last_words_that_found_no_room_are_made_up_for(lab, tmp_path, monkeypatch):
    processes, listener = lab
    processes.start("logger", "--help")
    for _ in range(MOST_WAITS):
        if processes.ended("logger"):
            break
        listener.spin(WAIT_S)
    RunFolder(tmp_path).process_log("logger").write_text("")
    with pytest.raises(LabStateError, match=r"(?s)logger died .*it said nothing"):
        processes.check()
    # From now on any disk is nearly full.
    monkeypatch.setattr(child_process, "SCARCE_BYTES", 1 << 62)
    with pytest.raises(LabStateError, match=r"disk of .*processes is full; make room on it"):
        processes.check()


@pytest.fixture
def default():
    """Give a function that makes a signal do what it does by default, until the test ends."""
    before = {}

    def make(number):
        before[number] = signal.signal(number, signal.SIG_DFL)

    yield make
    for number, handler in before.items():
        signal.signal(number, handler)


def test_a_lab_that_was_started_by_nohup_outlives_its_terminal(bus_url, tmp_path, default):
    default(signal.SIGHUP)
    signal.signal(signal.SIGHUP, signal.SIG_IGN)
    config = load_config(overrides=[f"bus.url={bus_url}"])
    with supervised(config, RunFolder(tmp_path), Listener(config)):
        os.kill(os.getpid(), signal.SIGHUP)


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP])
def test_the_end_of_the_terminal_ends_a_lab_as_ctrl_c_does(bus_url, tmp_path, number, default):
    default(number)
    config = load_config(overrides=[f"bus.url={bus_url}"])
    with (
        pytest.raises(KeyboardInterrupt),
        supervised(config, RunFolder(tmp_path), Listener(config)),
    ):
        os.kill(os.getpid(), number)


def test_it_is_said_where_only_sigkill_ended_a_process(bus_url, tmp_path, monkeypatch, capsys):
    config = load_config(overrides=[f"bus.url={bus_url}"])
    listener, told = Listener(config), []
    listener.subscribe(PROCESS, told.append)
    with supervised(config, RunFolder(tmp_path), listener) as processes:
        processes.start("logger")
        os.kill(processes.process("logger"), signal.SIGSTOP)
        # Of signals that wait together, SIGINT would be the first to be taken.
        os.waitpid(processes.process("logger"), os.WUNTRACED)
        monkeypatch.setattr(child_process, "PATIENCE_S", 0.05)
    assert f"logger did not end by itself: {KILLED}" in capsys.readouterr().err
    for _ in range(MOST_WAITS):
        if told:
            break
        listener.spin(WAIT_S)
    assert (told[0].state, told[0].ended) == (told[0].FINISHED, KILLED)


def test_a_summary_that_cannot_be_written_is_one_clear_message(tmp_path):
    folder = RunFolder(tmp_path)
    folder.summary.mkdir()
    with pytest.raises(NotWrittenError, match=r"summary\.json: cannot be .* whole: .*session\.lcm"):
        folder.write_summary(load_config(), {})

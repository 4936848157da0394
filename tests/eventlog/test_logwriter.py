"""Logs of several files, and disks that refuse."""

import os
import signal
import subprocess
import sys

import pytest

from koopman_lab.bus.channels import LOGGER_STATUS, MOCAP_POSE
from koopman_lab.bus.lockstep import Lockstep
from koopman_lab.config.load import load_config
from koopman_lab.data.decode import SessionLog
from koopman_lab.errors import LogError
from koopman_lab.eventlog.eventlog import read_events
from koopman_lab.eventlog.logwriter import EventLogWriter, RotatingLogWriter, files_of_log
from offboard.logger.node import LoggerNode

NAME = "R1_MOCAP_POSE"
CONFIG = load_config()


def pose(sequence):
    message = MOCAP_POSE.type()
    message.utime, message.sequence = 1_000 * sequence, sequence
    return message.encode()


def write(log, numbers):
    for number in numbers:
        log.write(NAME, pose(number), 1_000 * number)


def sequences(path):
    return SessionLog(path).array(MOCAP_POSE)["sequence"].tolist()


def events_of_one(file):
    """Return what one file of a log holds; the last may hold nothing yet."""
    return list(read_events(file)) if file.stat().st_size else []


def test_a_large_log_goes_on_in_a_next_file_and_is_read_as_one(tmp_path):
    path = tmp_path / "session.lcm"
    log = RotatingLogWriter(path, largest_bytes=1000)
    write(log, range(40))
    log.close()
    files = files_of_log(path)
    assert [file.name for file in files[:2]] == ["session.lcm", "session-0001.lcm"]
    assert len(files) > 3
    assert all(file.stat().st_size < 1000 + 200 for file in files)
    assert sequences(tmp_path) == sequences(path) == list(range(40))
    assert SessionLog(path).channels[NAME].lost == 0
    # Each file is a log of its own, for any tool of LCM.
    assert [MOCAP_POSE.type.decode(e.data).sequence for e in read_events(files[1])] == sequences(
        files[1]
    )


def test_a_file_is_full_from_just_so_many_bytes_on(tmp_path):
    sizes = []
    for spare in (0, 1):
        path = tmp_path / str(spare) / "session.lcm"
        path.parent.mkdir()
        log = RotatingLogWriter(path, largest_bytes=2 * (28 + len(NAME) + len(pose(0))) + spare)
        write(log, range(4))
        log.close()
        sizes.append([len(events_of_one(file)) for file in files_of_log(path)])
    assert sizes == [[2, 2, 0], [3, 1]]


def test_a_log_is_gone_on_with_only_when_asked(tmp_path):
    path = tmp_path / "session.lcm"
    for numbers, resume in ((range(3), False), (range(3, 6), True), (range(6, 8), True)):
        log = RotatingLogWriter(path, 10_000_000, resume=resume)
        write(log, numbers)
        log.close()
    assert sequences(path) == list(range(8))
    with pytest.raises(LogError, match="exists already"):
        RotatingLogWriter(path, 10_000_000)


def test_a_file_that_was_begun_and_never_written_is_passed_over(tmp_path):
    path = tmp_path / "session.lcm"
    with EventLogWriter(path) as log:
        write(log, range(3))
    (tmp_path / "session-0001.lcm").touch()
    assert sequences(path) == [0, 1, 2]


FULL_DISK = """
import resource, sys
from pathlib import Path
from koopman_lab.eventlog.logwriter import EventLogWriter
from koopman_lab.errors import LogError
resource.setrlimit(resource.RLIMIT_FSIZE, (5000, 5000))
log = EventLogWriter(Path(sys.argv[1]))
try:
    for number in range(1000):
        log.write("R1_X", bytes(100), number)
        if number % 7 == 0:
            log.flush()
except LogError as error:
    print(error)
    log.close()
"""


def test_a_full_disk_is_said_and_leaves_whole_events(tmp_path):
    """A limit on the size of files refuses as a full disk does."""
    path = tmp_path / "log.lcm"
    done = subprocess.run(
        [sys.executable, "-c", FULL_DISK, str(path)], capture_output=True, text=True, check=True
    )
    assert "cannot be written after" in done.stdout
    assert "File too large" in done.stdout
    assert not done.stderr
    stored = [event.timestamp_us for event in read_events(path)]
    assert len(stored) >= 28
    assert stored == list(range(len(stored)))


KILLED = """
import os, signal, sys
from pathlib import Path
from koopman_lab.eventlog.logwriter import EventLogWriter
log = EventLogWriter(Path(sys.argv[1]))
for number in range(5000):
    log.write("R1_X", bytes(100), number)
    if number == 4000:
        log.sync()
os.kill(os.getpid(), signal.SIGKILL)
"""


def test_ending_by_force_loses_nothing_that_was_handed_over(tmp_path):
    path = tmp_path / "log.lcm"
    done = subprocess.run([sys.executable, "-c", KILLED, str(path)], check=False)
    assert done.returncode == -signal.SIGKILL
    stored = [event.timestamp_us for event in read_events(path)]
    assert len(stored) > 4000
    assert stored == list(range(len(stored)))


def replaced(path):
    path.rename(path.with_name("elsewhere.lcm"))
    path.write_bytes(b"another")


def grown(path):
    with path.open("ab") as file:
        file.write(b"more")


HARMS = {
    "deleted": (lambda path: path.unlink(), "is gone .* was written once more"),
    "moved": (lambda path: path.rename(path.with_name("elsewhere.lcm")), "is gone"),
    "its folder moved": (lambda path: path.parent.rename(path.parent.parent / "x"), "is gone"),
    "replaced": (replaced, "is another file now"),
    "cut": (lambda path: os.truncate(path, 100), "has 100 bytes instead of"),
    "emptied": (lambda path: os.truncate(path, 0), "has 0 bytes instead of"),
    "written by others": (grown, "has .* bytes instead of"),
}


@pytest.mark.parametrize("harm", HARMS)
def test_a_log_that_is_not_what_was_written_is_noticed(harm, tmp_path):
    path = tmp_path / "run" / "session.lcm"
    path.parent.mkdir()
    log = RotatingLogWriter(path, 10_000_000)
    write(log, range(20))
    log.check()
    log.flush()
    log.check()
    do, words = HARMS[harm]
    do(path)
    with pytest.raises(LogError, match=f"session.lcm: {words}"):
        log.check()
    log.close()
    if harm == "deleted":
        assert sequences(path) == list(range(20))


def test_an_earlier_file_of_a_log_is_missed_too(tmp_path):
    path = tmp_path / "session.lcm"
    log = RotatingLogWriter(path, largest_bytes=1000)
    write(log, range(40))
    log.check()
    path.unlink()
    with pytest.raises(LogError, match=r"session\.lcm: has no bytes instead of"):
        log.check()
    log.close()


class Lab:
    """Speaks to a logger, and hears what it says."""

    name = "plant"

    def __init__(self):
        self.said = []

    def attach(self, port):
        self.port = port
        port.every(100.0, lambda _: self.speak())
        port.subscribe(LOGGER_STATUS, lambda m: self.said.append((m.utime, m.bytes)))

    def speak(self):
        self.port.publish(MOCAP_POSE, MOCAP_POSE.type())

    def close(self):
        pass


def test_the_logger_says_in_a_tenth_of_a_second_that_it_cannot_write_and_ends(tmp_path):
    lab, ears = Lockstep(CONFIG), Lab()
    lab.add(ears)
    lab.add(LoggerNode(CONFIG, tmp_path / "session.lcm"))
    lab.run(1.0)
    assert ears.said
    assert all(size > 0 for _, size in ears.said[1:])
    (tmp_path / "session.lcm").unlink()
    struck_us = lab.now_us
    with pytest.raises(LogError, match="is gone"):
        lab.run(1.0)
    assert lab.now_us - struck_us <= 100_000
    lab.close()

"""The record of a stop on the disk, and the lock of the one motor loop of a robot."""

import json
import os
import subprocess
import sys

import pytest
from hypothesis import given
from hypothesis import strategies as st

from koopman_lab.bus.motor_loop_faults import Fault
from koopman_lab.config.load import load_config
from koopman_lab.errors import LabStateError
from koopman_lab.files import STATE_VARIABLE
from onboard.motor_loop.board_state import LARGEST_NUMBER, StopFile, only_motor_loop
from onboard.motor_loop.stop_keeper import StopRecord

RECORDS = st.builds(
    StopRecord,
    st.integers(1 - LARGEST_NUMBER, LARGEST_NUMBER - 1),
    st.booleans(),
    st.sampled_from(Fault),
)
WHOLE = {"stop_number": 5, "holds": True, "fault": 0}
DAMAGED = [
    *(b"", b"\x00" * 40, b"\xff\xfe", b"[]", b"null", b"{", b'{"stop_number": 5}', b"[" * 100_000),
    *(
        json.dumps(WHOLE | change).encode()
        for change in (
            *({"stop_number": 5.5}, {"stop_number": True}, {"stop_number": 1 << 63}),
            *({"holds": 1}, {"holds": "no"}, {"fault": 99}, {"fault": None}, {"more": 1}),
        )
    ),
]


def config(name="R1", url="udpm://239.255.76.67:7667?ttl=0"):
    return load_config(overrides=[f"robot.name={name}", f"bus.url={url}"])


@pytest.fixture
def said():
    return []


@pytest.fixture
def store(tmp_path, said):
    return StopFile(tmp_path / "stops" / "R1.json", said.append)


@given(RECORDS)
def test_a_record_is_read_as_it_was_written(tmp_path_factory, record):
    store = StopFile(tmp_path_factory.mktemp("stops") / "R1.json", pytest.fail)
    assert store.read() is None
    store.write(record)
    assert store.read() == record


@pytest.mark.parametrize("content", DAMAGED, ids=range(len(DAMAGED)))
def test_a_damaged_record_is_refused_with_the_file_and_the_next_step(store, said, content):
    store.write(StopRecord(*WHOLE.values()))
    (file,) = (file for file in store._file.parent.iterdir())
    file.write_bytes(content)
    for _ in range(2):
        with pytest.raises(LabStateError, match=str(file)):
            store.read()
    (line,) = said
    assert STATE_VARIABLE in line


@given(st.data())
def test_no_cut_or_flipped_byte_is_taken_for_a_released_robot(tmp_path_factory, data):
    """A record that holds the robot holds it, or is refused."""
    store = StopFile(tmp_path_factory.mktemp("stops") / "R1.json", str)
    store.write(StopRecord(5, holds=True))
    whole = store._file.read_bytes()
    if data.draw(st.booleans()):
        damaged = whole[: data.draw(st.integers(0, len(whole) - 1))]
    else:
        at, bit = data.draw(st.integers(0, len(whole) - 1)), data.draw(st.integers(0, 7))
        damaged = whole[:at] + bytes([whole[at] ^ 1 << bit]) + whole[at + 1 :]
    store._file.write_bytes(damaged)
    try:
        record = store.read()
    except LabStateError:
        return
    assert record.holds


def test_a_folder_that_takes_no_file_is_refused(tmp_path, said):
    (tmp_path / "stops").write_text("a file where the folder should be")
    store = StopFile(tmp_path / "stops" / "R1.json", said.append)
    for act in (store.read, lambda: store.write(StopRecord(5, holds=True))):
        with pytest.raises(LabStateError, match="restart would not know of a stop"):
            act()
    assert said


def test_robots_and_buses_have_records_of_their_own(said):
    files = set()
    for name in ("R1", "R2"):
        for group in ("239.255.76.67", "239.255.76.68"):
            lab = config(name, f"udpm://{group}:7667?ttl=0")
            with only_motor_loop(lab, said.append) as store:
                files.add(store._file)
    assert len(files) == 4
    # How far messages go on the same bus makes no other robot.
    with only_motor_loop(config(url="udpm://239.255.76.67:7667?ttl=1"), said.append) as store:
        assert store._file in files


def test_a_second_loop_of_a_robot_is_refused_with_the_process_that_runs_the_first(said):
    with only_motor_loop(config(), said.append):
        match = rf"process {os.getpid()} runs the onboard program of R1"
        with (
            pytest.raises(LabStateError, match=match),
            only_motor_loop(config(), said.append),
        ):
            pytest.fail("two loops of one robot")
        with only_motor_loop(config("R2"), said.append):
            pass
    with only_motor_loop(config(), said.append):
        pass


def test_the_lock_goes_with_the_process_however_it_ends(said):
    program = (
        "import os, signal, sys\n"
        "from koopman_lab.config.load import load_config\n"
        "from onboard.motor_loop.board_state import only_motor_loop\n"
        "with only_motor_loop(load_config(), print):\n"
        "    os.kill(os.getpid(), signal.SIGKILL)\n"
    )
    done = subprocess.run([sys.executable, "-c", program], check=False)
    assert done.returncode < 0
    with only_motor_loop(load_config(), said.append):
        pass


def test_without_a_place_for_the_lock_the_record_is_refused(tmp_path, monkeypatch, said):
    blocked = tmp_path / "state"
    blocked.write_text("")
    monkeypatch.setenv(STATE_VARIABLE, str(blocked))
    with (
        only_motor_loop(config(), said.append) as store,
        pytest.raises(LabStateError, match=str(blocked)),
    ):
        store.read()

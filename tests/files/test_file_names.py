"""A name from elsewhere is one file in its folder, whatever it holds."""

import re

import pytest
from hypothesis import given
from hypothesis import strategies as st
from klab import klab

import lcmtypes
from koopman_lab.data.formats.table import writer_of
from koopman_lab.eventlog.eventlog import read_events
from koopman_lab.eventlog.logwriter import EventLogWriter
from koopman_lab.files import LONGEST_NAME, file_name

TEXTS = st.text() | st.text("./\\\0\nAa%-~ ", max_size=80)


@given(st.lists(TEXTS, unique=True))
def test_names_are_single_plain_and_different_even_without_case(texts):
    taken: set[str] = set()
    for text in texts:
        name = file_name(text, taken)
        assert re.fullmatch(r"[A-Za-z0-9_~%-][A-Za-z0-9_.~%-]*", name)
        assert len(name) <= LONGEST_NAME
        assert name.lower() not in taken
        taken.add(name.lower())


@pytest.mark.parametrize("text", ["R1_MOCAP_POSE", "LIDAR-2.scan", "a~b"])
def test_ordinary_names_stand_for_themselves(text):
    assert file_name(text) == text


ROBOTS = [
    *("../../x", "/tmp/x", "..", ".", "a/b", "a\\b", "C:\\x", "a\nb", "\x1b[2J", "con", "R1", "r1"),
    *("x" * 50, "\u202e", "[/0]", "%2F", "-rf", "~root", " "),
]


@pytest.fixture
def log(tmp_path):
    """Return a log with a channel of every robot, at which nothing may be written but beside it."""
    message = lcmtypes.mocap_pose_t()
    path = tmp_path / "inside" / "deep" / "odd.lcm"
    path.parent.mkdir(parents=True)
    with EventLogWriter(path) as writer:
        for number, robot in enumerate(ROBOTS):
            message.utime = number
            writer.write(f"{robot}_MOCAP_POSE", message.encode(), number)
    return path


def test_export_leaves_nothing_outside_its_folder(log, tmp_path):
    done = klab("log", "export", str(log))
    assert done.returncode == 0, done.stderr
    files = {file.relative_to(tmp_path) for file in tmp_path.rglob("*") if file.is_file()}
    folder = log.parent / "odd-csv"
    assert {file.parent for file in files} == {
        folder.relative_to(tmp_path),
        log.parent.relative_to(tmp_path),
    }
    written = writer_of("csv")(read_events(log), tmp_path / "again")
    assert len(list(folder.iterdir())) == len(written.channels) == len(ROBOTS)
    assert len({file.name.lower() for file in folder.iterdir()}) == len(ROBOTS)


def test_one_file_of_all_channels_keeps_their_names(log, tmp_path):
    from mcap.reader import make_reader

    writer_of("mcap")(read_events(log), tmp_path / "odd.mcap")
    with (tmp_path / "odd.mcap").open("rb") as stream:
        topics = {channel.topic for _, channel, _ in make_reader(stream).iter_messages()}
    assert topics == {f"{robot}_MOCAP_POSE" for robot in ROBOTS}
    assert {file.name for file in tmp_path.iterdir()} == {"inside", "odd.mcap"}

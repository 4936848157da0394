"""The whole-log index finds exactly what stepping from event to event finds."""

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from koopman_lab.errors import LogError
from koopman_lab.eventlog import index
from koopman_lab.eventlog.eventlog import HEADER as HEAD
from koopman_lab.eventlog.eventlog import LONGEST_NAME, SYNC_WORD, load_log, scan
from koopman_lab.eventlog.index import index_files, index_log
from koopman_lab.eventlog.logwriter import EventLogWriter
from koopman_lab.eventlog.message_blocks import Messages

SYNC = bytes.fromhex("eda1da01")
HEADER = 28
# Names of equal length, and data that look like the beginning of an event.
NAMES = st.sampled_from(["A", "B", "R1_MOCAP_POSE", "R2_MOCAP_POSE", "café", "N" * 63])
DATA = st.one_of(
    st.binary(max_size=60),
    st.binary(max_size=40).map(lambda data: SYNC + data),
    st.binary(max_size=8).map(lambda data: data + SYNC),
    st.just((SYNC + bytes(24)) * 2),
)
EVENTS = st.lists(st.tuples(NAMES, DATA, st.integers(-(2**62), 2**62)), min_size=1, max_size=12)


def write(folder, events, name="log.lcm"):
    path = folder / name
    path.unlink(missing_ok=True)
    with EventLogWriter(path) as log:
        for event in events:
            log.write(*event)
    return path


def rows(found):
    return {
        name: list(zip(messages, messages.arrival_us.tolist(), strict=True))
        for name, messages in found.items()
    }


def stepwise(path, content, salvage):
    found = {}
    for f in scan(path, content, salvage=salvage):
        found.setdefault(f.channel, []).append((content[f.start : f.stop], f.timestamp_us))
    return found


def at_once(path, content, salvage):
    return rows(index_log(path, content, salvage=salvage))


def outcome(read, *arguments):
    """Return what a way of reading finds, or what it says."""
    try:
        return read(*arguments)
    except LogError as error:
        return str(error)


@given(EVENTS)
def test_every_message_is_found_whatever_it_holds(tmp_path_factory, events):
    path = write(tmp_path_factory.getbasetemp(), events)
    wanted = {}
    for name, data, time_us in events:
        wanted.setdefault(name, []).append((data, time_us))
    found = index_log(path, load_log(path), salvage=False)
    assert list(found) == sorted(wanted)
    assert rows(found) == wanted


@pytest.fixture
def never_stepping(monkeypatch):
    """Let a test fail where a log is read event by event, which takes long."""

    def refuse(*_, **__):
        pytest.fail("read event by event")

    monkeypatch.setattr(index, "_event_by_event", refuse)


@pytest.mark.usefixtures("never_stepping")
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(EVENTS)
def test_no_unbroken_log_is_read_event_by_event(tmp_path_factory, events):
    path = write(tmp_path_factory.getbasetemp(), events)
    found = at_once(path, load_log(path), False)
    assert sum(map(len, found.values())) == len(events)


@pytest.mark.usefixtures("never_stepping")
@pytest.mark.parametrize("behind", [*range(40), index._CHUNK - 30, index._CHUNK, 2 * index._CHUNK])
def test_a_sync_word_may_stand_at_any_distance_from_the_end(tmp_path, behind):
    """Also where there is no room for a header behind it, or in another chunk of the search."""
    events = [("A", b"", 1), ("B", b"x" + SYNC + bytes(behind), 2)]
    path = write(tmp_path, events)
    expected = {name: [(data, time_us)] for name, data, time_us in events}
    assert at_once(path, load_log(path), False) == expected


@pytest.mark.usefixtures("never_stepping")
def test_the_smallest_event_may_be_the_only_one_and_the_last(tmp_path):
    for events in ([("A", b"", 7)], [("A", SYNC, 6), ("A", b"", 7)]):
        path = write(tmp_path, events)
        assert at_once(path, load_log(path), False)["A"][-1] == (b"", 7)


@pytest.mark.parametrize("size", [0, LONGEST_NAME + 1])
def test_a_name_that_lcm_cannot_carry_is_no_event_for_either_way_of_reading(tmp_path, size):
    def event(number, name):
        return HEAD.pack(SYNC_WORD, number, number, len(name), 3) + name + b"abc"

    content = event(0, b"A") + event(1, b"N" * size) + event(2, b"A")
    for salvage in (False, True):
        arguments = tmp_path / "log.lcm", content, salvage
        assert outcome(at_once, *arguments) == outcome(stepwise, *arguments)
    kept = {"A": [(b"abc", 0), (b"abc", 2)]}
    assert at_once(tmp_path / "log.lcm", content, True) == kept


@given(EVENTS, st.data())
def test_a_damaged_log_gives_what_stepping_through_it_gives(tmp_path_factory, events, data):
    path = write(tmp_path_factory.getbasetemp(), events)
    content = bytearray(path.read_bytes())
    at = data.draw(st.integers(0, len(content) - 1))
    if data.draw(st.booleans()):
        content[at] ^= data.draw(st.integers(1, 255))
    else:
        del content[at:]
    for salvage in (False, True):
        arguments = path, bytes(content), salvage
        assert outcome(at_once, *arguments) == outcome(stepwise, *arguments)


def test_a_length_that_reaches_just_to_a_later_event_swallows_none(tmp_path):
    path = write(tmp_path, [("A", bytes(12), time_us) for time_us in range(6)])
    content = bytearray(path.read_bytes())
    size = len(content) // 6
    # The data of the second event now seem to end where the fifth begins.
    content[size + 24 : size + 28] = (12 + 2 * size).to_bytes(4, "big")
    found = at_once(path, bytes(content), True)
    assert found == stepwise(path, bytes(content), True)
    assert [time_us for _, time_us in found["A"]] == [0, 2, 3, 4, 5]


def test_a_log_of_very_many_channels_is_read_too(tmp_path):
    events = [(f"C{number:04}", b"x", number) for number in range(300)]
    path = write(tmp_path, events)
    assert len(index_log(path, load_log(path), salvage=False)) == 300


def test_messages_from_no_log_are_kept_in_order():
    data = [b"abc", b"", b"de"]
    messages = Messages.joined(data)
    assert list(messages) == data
    assert messages.sizes.tolist() == [3, 0, 2]
    assert messages.arrival_us.tolist() == [0, 0, 0]
    assert len(Messages.joined(())) == 0
    for either in (messages, Messages.joined(())):
        assert {either.starts.dtype, either.stops.dtype, either.arrival_us.dtype} == {
            np.dtype(np.int64)
        }


@given(EVENTS, EVENTS)
def test_a_log_in_two_files_is_one(tmp_path_factory, first, second):
    folder = tmp_path_factory.getbasetemp()
    files = [write(folder, events, f"{n}.lcm") for n, events in enumerate((first, second))]
    whole = write(folder, first + second)
    together = index_files(files, salvage=False)
    assert list(together) == sorted(together)
    assert rows(together) == rows(index_files([whole], salvage=False))

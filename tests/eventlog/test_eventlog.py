import resource

import lcm
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from koopman_lab.errors import LogError
from koopman_lab.eventlog.eventlog import Damage, Event, load_log, read_events, scan
from koopman_lab.eventlog.logwriter import EventLogWriter

CHANNELS = st.text(st.characters(min_codepoint=33, max_codepoint=126), min_size=1, max_size=63)
MESSAGES = st.lists(
    st.tuples(CHANNELS, st.binary(max_size=200), st.integers(-(2**62), 2**62)), min_size=1
)
SYNC = bytes.fromhex("eda1da01")
HEADER = 28
EVENT = HEADER + len("R1_A") + 20


def write(path, messages):
    path.unlink(missing_ok=True)
    with EventLogWriter(path) as log:
        return [log.write(*message) for message in messages]


def numbered(messages):
    return [Event(i, t, channel, data) for i, (channel, data, t) in enumerate(messages)]


def plain(count):
    return [("R1_A", bytes([i % 251]) * 20, 1000 * i) for i in range(count)]


@settings(max_examples=50, deadline=None)
@given(MESSAGES)
def test_what_is_written_is_read(tmp_path_factory, messages):
    path = tmp_path_factory.getbasetemp() / "own.lcm"
    sizes = write(path, messages)
    assert sum(sizes) == path.stat().st_size
    assert list(read_events(path)) == numbered(messages)


@settings(max_examples=50, deadline=None)
@given(MESSAGES)
def test_same_bytes_as_the_log_of_the_lcm_library_and_each_reads_the_other(
    tmp_path_factory, messages
):
    own, other = (tmp_path_factory.getbasetemp() / name for name in ("own.lcm", "other.lcm"))
    write(own, messages)
    library = lcm.EventLog(str(other), "w", overwrite=True)
    for channel, data, timestamp_us in messages:
        library.write_event(timestamp_us, channel, data)
    library.close()

    assert own.read_bytes() == other.read_bytes()
    assert list(read_events(other)) == numbered(messages)
    theirs = [(e.eventnum, e.timestamp, e.channel, e.data) for e in lcm.EventLog(str(own))]
    assert theirs == numbered(messages)


def test_a_log_is_never_overwritten(tmp_path):
    path = tmp_path / "log.lcm"
    write(path, plain(1))
    with pytest.raises(LogError, match=r"log\.lcm: exists already"):
        EventLogWriter(path)
    assert list(read_events(path)) == numbered(plain(1))


def test_a_log_in_a_folder_that_is_not_there_is_refused(tmp_path):
    with pytest.raises(LogError, match="cannot be made"):
        EventLogWriter(tmp_path / "none" / "log.lcm")


@pytest.mark.parametrize("name", ["", "A" * 64])
def test_a_channel_name_lcm_cannot_carry_is_refused(tmp_path, name):
    with (
        EventLogWriter(tmp_path / "log.lcm") as log,
        pytest.raises(LogError, match="LCM carries 1 to 63"),
    ):
        log.write(name, b"", 0)


def test_flushed_events_can_be_read_while_the_log_is_open(tmp_path):
    path = tmp_path / "log.lcm"
    with EventLogWriter(path) as log:
        log.write("A", b"1", 5)
        log.flush()
        assert [event.data for event in read_events(path)] == [b"1"]


def test_a_disk_that_refuses_is_one_clear_message(tmp_path):
    path = tmp_path / "log.lcm"
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    log = EventLogWriter(path)
    log.write("A", bytes(100_000), 0)
    resource.setrlimit(resource.RLIMIT_FSIZE, (100_500, hard))
    try:
        words = r"log\.lcm: cannot be written after 1 events: .*; see whether the disk is full\. "
        with pytest.raises(LogError, match=f"{words}What was written before is whole"):
            log.write("A", bytes(100_000), 0)
        log.close()
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


@pytest.mark.parametrize("before", [0, 1, 3])
def test_a_log_goes_on_without_a_gap_once_the_disk_takes_more(tmp_path, before):
    path = tmp_path / "log.lcm"
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    with EventLogWriter(path) as log:
        for message in plain(before):
            log.write(*message)
            log.flush()  # never before the first: what fails may be the first of all
        assert log.size == before * EVENT
        resource.setrlimit(resource.RLIMIT_FSIZE, (before * EVENT + 10, hard))
        try:
            for message in plain(2):
                log.write(*message)
            with pytest.raises(LogError, match=f"cannot be written after {before} events"):
                log.flush()
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
        assert log.size == before * EVENT == path.stat().st_size
        assert log.write("R1_A", bytes(20), 7) == EVENT
    events = numbered([*plain(before), ("R1_A", bytes(20), 7)])
    assert list(read_events(path)) == events


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (None, "no such log"),
        (b"", "is empty"),
        (b"not a log at all, but long enough to hold a header", "not an LCM event log"),
        (SYNC, "damaged at byte 0 of 4, after 0 intact events; use --salvage"),
    ],
)
def test_what_is_no_log_is_refused_in_words(tmp_path, content, words):
    path = tmp_path / "broken.lcm"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(LogError, match=words) as error:
        list(read_events(path))
    assert str(path) in str(error.value)


def test_a_folder_is_no_log(tmp_path):
    with pytest.raises(LogError, match="cannot be read as a log"):
        read_events(tmp_path)


def test_a_file_without_any_intact_event_is_refused_even_by_salvage(tmp_path):
    path = tmp_path / "broken.lcm"
    path.write_bytes(b"junk" + SYNC + b"junk")
    with pytest.raises(LogError, match="holds no intact event"):
        list(read_events(path, salvage=True))


def damaged(tmp_path, messages, harm):
    """Write a log and change its bytes; return its path, where each event begins, and all."""
    path = tmp_path / "log.lcm"
    sizes = write(path, messages)
    begins = [sum(sizes[:i]) for i in range(len(sizes) + 1)]
    content = bytearray(path.read_bytes())
    path.write_bytes(harm(content, begins))
    return path, begins, numbered(messages)


def zeroed(first, last):
    def harm(content, begins):
        content[begins[first] : begins[last]] = bytes(begins[last] - begins[first])
        return content

    return harm


def sync_word_zeroed(content, begins):
    content[begins[4] : begins[4] + 4] = bytes(4)
    return content


def sync_word_within(content, begins):
    """Zero an event, and let a sync word stand there that begins none."""
    zeroed(4, 5)(content, begins)
    content[begins[4] + 9 : begins[4] + 13] = SYNC
    return content


def with_length(event, field, value):
    def harm(content, begins):
        at = begins[event] + {"name": 20, "data": 24}[field]
        content[at : at + 4] = value.to_bytes(4, "big")
        return content

    return harm


@pytest.mark.parametrize(
    ("harm", "lost"),
    [
        pytest.param(zeroed(3, 7), {3, 4, 5, 6}, id="zeroed events"),
        pytest.param(zeroed(0, 2), {0, 1}, id="zeroed start"),
        pytest.param(zeroed(8, 10), {8, 9}, id="zeroed end"),
        pytest.param(sync_word_zeroed, {4}, id="zeroed sync word"),
        pytest.param(sync_word_within, {4}, id="zeroed event with a sync word"),
        pytest.param(lambda c, _: c[:-1], {9}, id="cut in the data"),
        pytest.param(lambda c, b: c[: b[9] + 11], {9}, id="cut in the header"),
        pytest.param(lambda c, b: c[: b[9] + 2], {9}, id="cut in the sync word"),
        pytest.param(lambda c, _: c + b"\0" * 500, set(), id="junk after the end"),
        pytest.param(with_length(4, "data", 2**32 - 1), {4}, id="length beyond the file"),
        pytest.param(with_length(4, "data", 90), {4}, id="length over the next events"),
        pytest.param(with_length(4, "data", 3), {4}, id="length too small"),
        pytest.param(with_length(4, "data", 20 + EVENT), {4}, id="length over just one event"),
        pytest.param(with_length(4, "data", 20 + 3 * EVENT), {4}, id="length over just three"),
        pytest.param(with_length(0, "data", 20 + 9 * EVENT), {0}, id="length over all the others"),
        pytest.param(with_length(8, "data", 20 + EVENT), {8}, id="length over just the last"),
        pytest.param(with_length(4, "data", 2**31), {4}, id="length of 2 GB"),
        pytest.param(with_length(4, "name", 0), {4}, id="no name"),
        pytest.param(with_length(4, "name", 2**31), {4}, id="endless name"),
        pytest.param(
            lambda c, b: zeroed(3, 4)(zeroed(5, 6)(c, b), b), {3, 5}, id="one between two"
        ),
    ],
)
def test_salvage_keeps_every_intact_event_and_reports_the_rest(tmp_path, harm, lost):
    path, begins, events = damaged(tmp_path, plain(10), harm)
    damage: list[Damage] = []
    kept = list(read_events(path, salvage=True, damage=damage))
    assert kept == [event for event in events if event.number not in lost]
    intact_bytes = sum(begins[e.number + 1] - begins[e.number] for e in kept)
    assert sum(d.size for d in damage) == path.stat().st_size - intact_bytes

    first = min(lost, default=10)
    words = rf"damaged at byte {begins[first]} of \d+, after {first} intact events"
    with pytest.raises(LogError, match=words):
        list(read_events(path))


def test_damage_tells_place_and_time_span(tmp_path):
    path, begins, _ = damaged(tmp_path, plain(10), zeroed(3, 7))
    damage: list[Damage] = []
    list(read_events(path, salvage=True, damage=damage))
    assert damage == [Damage(begins[3], begins[7] - begins[3], 2000, 7000)]
    assert str(damage[0]) == f"{4 * (HEADER + 4 + 20)} bytes at byte {begins[3]}, 0.005 s"


@pytest.mark.parametrize(
    ("first", "last", "told"),
    [(0, 2, "at the start"), (8, 10, "at the end"), (0, 1, "at the start")],
)
def test_damage_at_an_end_of_the_log_says_at_which(tmp_path, first, last, told):
    path, begins, _ = damaged(tmp_path, plain(10), zeroed(first, last))
    damage: list[Damage] = []
    list(read_events(path, salvage=True, damage=damage))
    assert damage[0].duration_s is None
    assert str(damage[0]) == f"{begins[last] - begins[first]} bytes at byte {begins[first]}, {told}"


@pytest.mark.parametrize("size", [1, 2, 27, 28, 29])
def test_bytes_before_the_first_event_cost_none(tmp_path, size):
    path, _, events = damaged(tmp_path, plain(10), lambda content, _: b"?" * size + content)
    damage: list[Damage] = []
    assert list(read_events(path, salvage=True, damage=damage)) == events
    assert damage == [Damage(0, size, None, 0)]


def test_logs_one_behind_the_other_in_a_file_are_read_as_one(tmp_path):
    """Their numbers begin again; the second is the longer one, and goes on beyond the first's."""
    path = tmp_path / "log.lcm"
    parts = []
    for count in (3, 6):
        write(path, plain(count))
        parts.append(path.read_bytes())
    path.write_bytes(b"".join(parts))
    damage: list[Damage] = []
    together = list(read_events(path, salvage=True, damage=damage))
    assert together == numbered(plain(3)) + numbered(plain(6))
    assert damage == []


def test_an_intact_log_has_no_damage(tmp_path):
    path = tmp_path / "log.lcm"
    write(path, plain(3))
    damage: list[Damage] = []
    assert list(read_events(path, salvage=True, damage=damage)) == numbered(plain(3))
    assert damage == []


def test_data_that_look_like_an_event_are_data(tmp_path):
    inner = tmp_path / "inner.lcm"
    write(inner, plain(2))
    messages = [("A", inner.read_bytes(), 1), ("B", SYNC * 5, 2)]
    write(tmp_path / "outer.lcm", messages)
    assert list(read_events(tmp_path / "outer.lcm")) == numbered(messages)


@settings(max_examples=100, deadline=None)
@given(st.data())
def test_salvage_ends_and_accounts_for_every_byte_whatever_the_harm(tmp_path_factory, data):
    path = tmp_path_factory.getbasetemp() / "harmed.lcm"
    write(path, plain(12))
    content = bytearray(path.read_bytes())
    for _ in range(data.draw(st.integers(1, 4))):
        at = data.draw(st.integers(0, len(content) - 1))
        junk = data.draw(st.binary(min_size=1, max_size=40) | st.just(SYNC))
        content[at : at + len(junk)] = junk
    path.write_bytes(content)
    damage: list[Damage] = []
    try:
        kept = list(scan(path, load_log(path), salvage=True, damage=damage))
    except LogError:
        return
    intact_bytes = sum(frame.stop - frame.begin for frame in kept)
    assert sum(d.size for d in damage) + intact_bytes == len(content)

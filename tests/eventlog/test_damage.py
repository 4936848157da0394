"""Damage at random places of a real log: no exception, no endless loop, nothing lost in silence."""

from itertools import islice
from pathlib import Path

import numpy as np
import pytest

from koopman_lab.data.decode import SessionLog
from koopman_lab.errors import LogError
from koopman_lab.eventlog.eventlog import Damage, load_log, read_events, scan

REFERENCE = Path(__file__).parents[1] / "data" / "reference" / "calibration.lcm"
EVENTS = 500
ZEROS = 300


@pytest.fixture(scope="module")
def log():
    """Return the beginning of a recorded log and where its events lie."""
    whole = load_log(REFERENCE)
    frames = list(islice(scan(REFERENCE, whole, salvage=False), EVENTS))
    return whole[: frames[-1].stop], frames


def salvaged(path, content):
    """Write, read with salvage, and see that every byte is accounted for."""
    path.write_bytes(content)
    damage: list[Damage] = []
    events = list(read_events(path, salvage=True, damage=damage))
    intact = sum(28 + len(e.channel.encode()) + len(e.data) for e in events)
    assert intact + sum(d.size for d in damage) == len(content)
    return events, damage


def of(content, frame):
    return frame.number, frame.timestamp_us, frame.channel, content[frame.start : frame.stop]


def test_a_log_cut_at_200_random_places_keeps_every_whole_event(log, tmp_path):
    content, frames = log
    path = tmp_path / "cut.lcm"
    for cut in np.random.default_rng(1).integers(1, len(content), 200).tolist():
        whole = [frame for frame in frames if frame.stop <= cut]
        if not whole:
            continue
        events, damage = salvaged(path, content[:cut])
        assert events == [of(content, frame) for frame in whole]
        rest = cut - whole[-1].stop
        assert [(d.offset, d.size, d.duration_s) for d in damage] == (
            [(whole[-1].stop, rest, None)] if rest else []
        )
        if rest:
            with pytest.raises(LogError, match=f"damaged at byte {whole[-1].stop} of {cut}"):
                list(read_events(path))


def test_zeros_at_50_random_places_cost_only_the_events_they_touch(log, tmp_path):
    content, frames = log
    path = tmp_path / "zeros.lcm"
    for at in np.random.default_rng(2).integers(0, len(content) - ZEROS, 50).tolist():
        end = at + ZEROS
        events, damage = salvaged(path, content[:at] + bytes(ZEROS) + content[end:])
        touched = {f.number for f in frames if f.begin < end and f.stop > at}
        kept = {event.number: event for event in events}
        for frame in frames:
            if frame.number not in touched:
                assert kept[frame.number] == of(content, frame)
        # Some zeros fall inside one event's data, and leave its frame as it was.
        assert damage or len(events) == len(frames)
        for stretch in damage:
            assert stretch.duration_s is None or 0.0 <= stretch.duration_s < 0.1
        session = SessionLog(path, salvage=True)
        assert sum(c.count for c in session.channels.values()) == len(events)
        assert session.damage == damage


@pytest.mark.parametrize(("field", "largest"), [(20, 80), (24, 400), (20, 2**32), (24, 2**32)])
def test_wrong_lengths_cost_only_the_events_that_bear_them(log, tmp_path, field, largest):
    content, frames = log
    path = tmp_path / "lengths.lcm"
    rng = np.random.default_rng(field)
    for _ in range(50):
        # Too short a length of the last event is an intact one and junk after it.
        frame = frames[rng.integers(len(frames) - 1)]
        length = int(rng.integers(largest))
        at = frame.begin + field
        if length.to_bytes(4, "big") == content[at : at + 4]:
            continue
        changed = content[:at] + length.to_bytes(4, "big") + content[at + 4 :]
        events, damage = salvaged(path, changed)
        assert events == [of(content, f) for f in frames if f is not frame]
        assert [d.offset for d in damage] == [frame.begin]


@pytest.mark.parametrize("number", [0, 250, EVENTS - 1])
@pytest.mark.parametrize("field", [20, 24])
def test_a_length_of_two_gigabytes_is_passed_over(log, tmp_path, number, field):
    content, frames = log
    at = frames[number].begin + field
    changed = content[:at] + (2**31).to_bytes(4, "big") + content[at + 4 :]
    events, damage = salvaged(tmp_path / "huge.lcm", changed)
    assert len(events) == EVENTS - 1
    assert [d.size for d in damage] == [frames[number].stop - frames[number].begin]


@pytest.mark.parametrize(
    "content",
    [b"", b"no log, only words\n" * 1000, bytes(1000), bytes.fromhex("eda1da01") * 50_000],
    ids=["empty", "text", "zeros", "only sync words"],
)
@pytest.mark.parametrize("salvage", [False, True])
def test_what_holds_no_event_is_one_message(tmp_path, content, salvage):
    path = tmp_path / "none.lcm"
    path.write_bytes(content)
    with pytest.raises(LogError, match=r"none\.lcm: "):
        SessionLog(path, salvage=salvage)

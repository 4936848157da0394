"""Logs that nobody wrote by accident: read or refused, within the time and memory of any log."""

import os
import struct
import tracemalloc

import pytest

from koopman_lab.errors import LogError
from koopman_lab.eventlog.eventlog import Damage, load_log, read_events
from koopman_lab.eventlog.index import index_log

ODD_NAMES = [
    b"tab\tX",
    b"R1_\xdc",
    b"\x1b[2J",
    b"[/0]",
    b"a" * 63,
    "\u202eR1".encode(),
    b"\xed\xa1",
]


@pytest.mark.parametrize("name", ODD_NAMES)
def test_an_event_is_intact_whatever_lcm_takes_for_a_name(name, tmp_path):
    path = tmp_path / "odd.lcm"
    path.write_bytes(b"".join(encoded(k, n) for k, n in enumerate([b"R1_A", name, name, b"R1_A"])))
    read = list(read_events(path))
    assert [event.number for event in read] == [0, 1, 2, 3]
    assert read[1].channel == read[2].channel == name.decode(errors="backslashreplace")
    messages = index_log(path, path.read_bytes(), salvage=False)
    assert {n: len(m) for n, m in messages.items()} == {"R1_A": 2, read[1].channel: 2}


@pytest.mark.parametrize("name", [b"", b"\0", b"R1\0", b"a" * 64])
def test_what_lcm_cannot_carry_is_no_event(name, tmp_path):
    path = tmp_path / "odd.lcm"
    path.write_bytes(encoded(0, b"R1_A") + encoded(1, name) + encoded(2, b"R1_A"))
    with pytest.raises(LogError, match="damaged at byte 33"):
        list(read_events(path))
    damage: list[Damage] = []
    kept = list(read_events(path, salvage=True, damage=damage))
    assert [event.number for event in kept] == [0, 2]
    assert sum(d.size for d in damage) == len(encoded(1, name))


def encoded(number, name, data=b"x", length=None):
    length = len(data) if length is None else length
    head = struct.pack(">IqqII", 0xEDA1DA01, number, number, len(name), length)
    return head + name + data


HOSTILE = {
    "headers within headers": lambda n: b"".join(
        encoded(7, b"A", b"", n - 29 * (k + 2)) for k in range(n // 29 - 2)
    ) + encoded(8, b"A", b"") + encoded(9, b"A", b""),
    "sync words": lambda n: bytes.fromhex("eda1da01") * (n // 4),
    "lengths beyond the file": lambda n: encoded(0, b"A", b"", 0xFFFFFFFF) * (n // 29),
    "names beyond the file": lambda n: struct.pack(">IqqII", 0xEDA1DA01, 0, 0, 0xFFFFFFFF, 0)
    * (n // 28),
    "the same event": lambda n: encoded(0, b"A", b"") * (n // 29),
    "channels without end": lambda n: b"".join(
        encoded(k, f"{k:06}".encode()) for k in range(n // 35)
    ),
    "zeros": lambda n: encoded(0, b"A") + bytes(n),
}  # fmt: skip


@pytest.mark.parametrize("log", HOSTILE.values(), ids=HOSTILE)
@pytest.mark.parametrize("salvage", [False, True])
def test_no_log_makes_more_work_or_memory_than_it_is_long(log, salvage, tmp_path):
    path = tmp_path / "hostile.lcm"
    path.write_bytes(log(300_000))
    size = path.stat().st_size
    tracemalloc.start()
    try:
        messages = index_log(path, load_log(path), salvage=salvage)
        assert sum(len(m) for m in messages.values()) <= size // 29
    except LogError:
        pass
    finally:
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
    assert peak < 40 * size


def test_a_log_is_a_file(tmp_path):
    os.mkfifo(tmp_path / "pipe.lcm")
    for path in (tmp_path, tmp_path / "pipe.lcm", "/dev/zero"):
        with pytest.raises(LogError, match="no file"):
            load_log(path)


def test_headers_within_headers_end_before_all_of_them_are_searched(tmp_path):
    path = tmp_path / "hostile.lcm"
    path.write_bytes(HOSTILE["headers within headers"](300_000))
    with pytest.raises(LogError, match="damaged throughout, as no accident leaves it"):
        index_log(path, load_log(path), salvage=True)

"""What a node said once beside what it says now: counts first, then where they differ."""

from __future__ import annotations

import math
import struct
from bisect import bisect_right
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from koopman_lab.bus.channels import split_name
from koopman_lab.bus.header import header_reader
from koopman_lab.config.load import parse_config
from koopman_lab.errors import ConfigError
from koopman_lab.replay.node_rerun import Output
from koopman_lab.units import US_PER_S

VERSION = {"version"}
"""Says which program spoke, and therefore may differ."""
OF_THE_MACHINE = VERSION | {
    *("utime", "sequence", "ping_utime", "received_utime", "pose_age_us"),
    *("solve_ms", "ticks", "missed_ticks", "worst_lateness_us"),
}
"""Fields that in real time say when something was run, and not what came out."""
CONFIG = "config_yaml"
ARRIVAL = "arrival_us"
FARTHEST_S = 0.5
"""Messages of a run in real time that are farther apart are not the same one."""
SLACK_US = 2_000
"""How far the board's idea of the desk's time can differ from one run to the next."""


class FieldDifference(NamedTuple):
    """A field (or entry of an array) that was ``recorded`` and is ``again``."""

    name: str
    recorded: object
    again: object


class Difference(NamedTuple):
    """A message that differs.

    Attributes
    ----------
    channel, number
        Its channel and sequence number.
    at_us
        When it was recorded (us).
    fields
        What differs.
    """

    channel: str
    number: int | None
    at_us: int
    fields: tuple[FieldDifference, ...]


@dataclass
class Agreement:
    """How the messages of one channel agree with those recorded.

    Attributes
    ----------
    equal, different
        Messages that were recorded and came again.
    missing, extra
        Recorded, but they did not come again; came, but were not recorded.
    beyond
        Came at the log's last time and later, where the log may have been cut off.
    differences
        The differences of each message that differs, in order.
    largest
        The largest difference of numbers, by field.
    """

    equal: int = 0
    different: int = 0
    missing: int = 0
    extra: int = 0
    beyond: int = 0
    differences: list[Difference] = field(default_factory=list)
    largest: dict[str, float] = field(default_factory=dict)


def compare(
    recorded: Sequence[Output],
    again: Sequence[Output],
    end_us: int,
    *,
    tolerance: float = 0.0,
    in_real_time: bool = False,
) -> dict[str, Agreement]:
    """Return by channel how two sequences of messages agree.

    In lockstep a message's partner bears the same number and must be equal in every byte and in
    its time of arrival. In real time it is the one that was due then, and fields that tell when
    something was run are left out.

    Parameters
    ----------
    recorded, again
        Messages in order of arrival.
    end_us
        Last time of the log (us).
    tolerance
        Numbers may differ by this much: absolutely where they are below 1, else relatively.
    in_real_time
        Whether the record was made in real time.
    """
    ignored = OF_THE_MACHINE if in_real_time else VERSION
    find = _by_time if in_real_time else _by_number
    before, after = _by_channel(recorded), _by_channel(again)
    agreements = {}
    for name in sorted(before.keys() | after.keys()):
        agreement = agreements[name] = Agreement()
        decode = split_name(name)[1].type.decode
        for old, new in find(before[name], after[name]):
            if old is None and new is not None:
                if new.at_us >= end_us:
                    agreement.beyond += 1
                else:
                    agreement.extra += 1
            elif new is None:
                agreement.missing += 1
            elif old is not None:
                _compare(old, new, decode, agreement, ignored, tolerance)
    return agreements


def _by_channel(outputs: Sequence[Output]) -> defaultdict[str, list[Output]]:
    channels: defaultdict[str, list[Output]] = defaultdict(list)
    for output in outputs:
        channels[output.name].append(output)
    return channels


Pair = tuple[Output | None, Output | None]


def _by_number(before: list[Output], after: list[Output]) -> Iterator[Pair]:
    """Pair messages of the same number; the radio can bring a number twice."""
    left = dict(_numbered(after))
    for key, output in _numbered(before):
        yield output, left.pop(key, None)
    for output in left.values():
        yield None, output


def _numbered(outputs: list[Output]) -> Iterator[tuple[tuple[int | None, int], Output]]:
    seen: Counter[int | None] = Counter()
    for output in outputs:
        number = _number(output)
        yield (number, seen[number]), output
        seen[number] += 1


def _number(output: Output) -> int | None:
    header = _header(output)
    return None if header is None else header[1]


def _by_time(before: list[Output], after: list[Output]) -> Iterator[Pair]:
    """Pair each recorded message with the last one that was due by then and is still alone.

    In real time a tick runs when it is due or later, and some not at all.
    """
    times = [_utime(output) for output in after]
    free = 0
    for output in before:
        utime = _utime(output)
        index = bisect_right(times, utime + SLACK_US, lo=free) - 1
        if index < free or utime - times[index] > FARTHEST_S * US_PER_S:
            yield output, None
            continue
        yield from ((None, extra) for extra in after[free:index])
        yield output, after[index]
        free = index + 1
    yield from ((None, extra) for extra in after[free:])


def _utime(output: Output) -> int:
    header = _header(output)
    return output.at_us if header is None else header[0]


def _header(output: Output) -> tuple[int, int] | None:
    return header_reader(split_name(output.name)[1].type)(output.data)


def _compare(
    old: Output,
    new: Output,
    decode: Callable[[bytes], Any],
    agreement: Agreement,
    ignored: set[str],
    tolerance: float,
) -> None:
    if old.data == new.data and (old.at_us == new.at_us or ignored is OF_THE_MACHINE):
        agreement.equal += 1
        return
    differences = []
    if old.at_us != new.at_us and ignored is not OF_THE_MACHINE:
        differences.append(FieldDifference(ARRIVAL, old.at_us, new.at_us))
    for name, was, now in _field_values(old, new, decode, ignored):
        if _agree(was, now, tolerance):
            continue
        differences.append(FieldDifference(name, was, now))
        if isinstance(was, (int, float)) and isinstance(now, (int, float)):
            distance = abs(now - was)
            agreement.largest[name] = max(distance, agreement.largest.get(name, 0.0))
    if not differences:
        agreement.equal += 1
        return
    agreement.different += 1
    agreement.differences.append(Difference(old.name, _number(old), old.at_us, tuple(differences)))


def _field_values(
    old: Output, new: Output, decode: Callable[[bytes], Any], ignored: set[str]
) -> Iterator[tuple[str, Any, Any]]:
    try:
        was, now = decode(old.data), decode(new.data)
    except (ValueError, struct.error):
        yield "bytes", old.data.hex(), new.data.hex()
        return
    for name in was.__slots__:
        if name in ignored:
            continue
        a, b = getattr(was, name), getattr(now, name)
        if name == CONFIG:
            # Written by another version it has other keys, and yet may mean the same.
            a, b = _parsed_config(a), _parsed_config(b)
        if isinstance(a, (list, tuple)):
            if len(a) != len(b):
                yield f"len({name})", len(a), len(b)
            for index, (x, y) in enumerate(zip(a, b, strict=False)):
                yield f"{name}[{index}]", x, y
        else:
            yield name, a, b


def _parsed_config(text: str) -> object:
    try:
        return parse_config(text, CONFIG)
    except ConfigError:
        return text


def _agree(was: object, now: object, tolerance: float) -> bool:
    if isinstance(was, float) and isinstance(now, float):
        if math.isnan(was) or math.isnan(now):
            return math.isnan(was) and math.isnan(now)
        return was == now or abs(now - was) <= tolerance * max(1.0, abs(was), abs(now))
    return was == now

"""Who speaks on one stream now: one publisher or several, and whether its numbers count.

A stream of the robot, of its board or of its cameras has one publisher. A second program under the
same robot's name gives two robots for one, and whoever listens believes now this one, now that one.
LCM says nothing of who sent a message; its number and its stamp do.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable
from typing import Any, Literal, NamedTuple

from koopman_lab.bus.channel import ABOARD, Channel
from koopman_lab.bus.sequence import MOST_OTHER_PUBLISHERS, SequenceCounter
from koopman_lab.units import US_PER_S

TURNS = 3
"""Who has spoken so often between the messages of others is a publisher beside them."""
TURNS_APART_S = 0.1
"""Turns sooner one after the other count once: so long a message is overtaken, as at a restart or
where a publisher comes to the number at which the one before it ended."""
TURNS_WITHIN_S = 5.0
"""In so long, so that one message a second is seen."""
GONE_S = 1.0
"""Who was not heard for so long, and for as long as its last turns took, is there no more."""
LATEST_FRAMES = 12
FEWEST_TIMES = 7
"""So many messages that all come twice bear at most so many times."""
LATEST_COPIES = 32
LARGEST_SHARE = 0.5
"""A radio copies a few messages; where half of those have copies, somebody sends all twice."""

Numbering = Literal["counts", "stands still", "starts again", "repeats"]
"""How a stream is numbered: as it should be; always by the same number; from anew with nearly every
message; or so that each message comes more than once, as a copy or under a number of its own."""


class StreamIdentity(NamedTuple):
    """Who speaks on a stream at one time.

    Attributes
    ----------
    publishers
        How many speak at once, at least 1. One that started again, after the one before fell
        silent, is one.
    numbering
        Whether the numbers of the messages count.
    """

    publishers: int = 1
    numbering: Numbering = "counts"

    @property
    def clear(self) -> bool:
        """Return whether one publisher speaks, and numbers its messages as it should."""
        return self.publishers == 1 and self.numbering == "counts"


def worse(one: StreamIdentity, other: StreamIdentity) -> StreamIdentity:
    """Return the worse of two: with more publishers, or with numbers that do not count."""
    return max(one, other, key=lambda identity: (identity.publishers, not identity.clear))


class Publishers:
    """Tells the publishers of one stream apart, by the numbers and stamps of its messages."""

    def __init__(self) -> None:
        self.counter = SequenceCounter()
        self._turns: dict[int, deque[int]] = {0: deque(maxlen=TURNS)}
        """By publisher when it began to speak after another one (us): its newest turns."""
        self._starts: deque[int] = deque(maxlen=MOST_OTHER_PUBLISHERS + 1)
        """When publishers spoke for the first time, the first one left out (us)."""

    def take(self, sequence: int, utime: int, arrived_us: int) -> None:
        """Take the number of a message, its sender's stamp, and when it arrived (us)."""
        counter = self.counter
        publisher = counter.publisher
        counter.update(sequence, utime)
        if counter.publisher != publisher:
            self._note_turn(counter.publisher, arrived_us)

    def identity(self, now_us: int) -> StreamIdentity:
        """Return who speaks at ``now_us``, by the clock of the arrivals."""
        numbering = self._numbering(now_us)
        if numbering == "starts again":
            return StreamIdentity(numbering=numbering)  # who says what, nobody can tell
        present = sum(_go_on(turns, now_us) for turns in self._turns.values())
        return StreamIdentity(max(1, present), numbering)

    def _note_turn(self, publisher: int, arrived_us: int) -> None:
        """Take that another publisher speaks than before."""
        turns = self._turns.get(publisher)
        if turns is None:
            if len(self._turns) > MOST_OTHER_PUBLISHERS:
                del self._turns[min(self._turns, key=lambda p: max(self._turns[p], default=0))]
            turns = self._turns[publisher] = deque(maxlen=TURNS)
            self._starts.append(arrived_us)
        if not turns or arrived_us - turns[-1] >= TURNS_APART_S * US_PER_S:
            turns.append(arrived_us)

    def _numbering(self, now_us: int) -> Numbering:
        counter = self.counter
        if counter.stands_still:
            return "stands still"
        if _go_on(self._starts, now_us):
            return "starts again"
        times = counter.newest_times(LATEST_FRAMES)
        if None not in times and 1 < len(set(times)) <= FEWEST_TIMES:
            return "repeats"
        copied = counter.share_copied(LATEST_COPIES) >= LARGEST_SHARE
        return "repeats" if copied else "counts"


def _go_on(times_us: deque[int], now_us: int) -> bool:
    """Return whether events that happened at the last of these times still go on."""
    if len(times_us) != times_us.maxlen:
        return False
    took_us, age_us = times_us[-1] - times_us[0], now_us - times_us[-1]
    return took_us <= TURNS_WITHIN_S * US_PER_S and age_us <= max(GONE_S * US_PER_S, took_us)


class NamedIdentity(NamedTuple):
    """Who speaks on a channel, and how fast.

    Attributes
    ----------
    name
        The channel's name on the bus.
    channel
        Its row of the table.
    identity
        Who speaks.
    rate_hz, nominal_hz
        Messages per second, and how many there should be; None where nobody knows.
    """

    name: str
    channel: Channel[Any]
    identity: StreamIdentity
    rate_hz: float | None = None
    nominal_hz: float | None = None


def identity_faults(streams: Iterable[NamedIdentity]) -> list[str]:
    """Return in words what is wrong with who speaks, a line for each robot and kind of fault.

    Channels on which several may speak are passed over.
    """
    lines: dict[tuple[str, str], list[NamedIdentity]] = {}
    for stream in streams:
        if stream.channel.has_one_publisher and not stream.identity.clear:
            several = stream.identity.publishers > 1
            kind = "several" if several else stream.identity.numbering
            robot_name = stream.name.removesuffix(f"_{stream.channel.suffix}")
            lines.setdefault((robot_name, kind), []).append(stream)
    return [_fault(*key, members) for key, members in lines.items()]


def _fault(robot_name: str, kind: str, streams: list[NamedIdentity]) -> str:
    names = ", ".join(f"{stream.name}{_rate(stream)}" for stream in streams)
    who = " or ".join(dict.fromkeys(_speaker(stream.channel) for stream in streams))
    other = f"stop it, or give it another --robot-name than {robot_name}"
    if kind == "several":
        count = max(stream.identity.publishers for stream in streams)
        return f"{names}: {count} publishers; a second {who} uses the name {robot_name}: {other}"
    if kind == "repeats":
        return (
            f"{names}: each message comes more than once; the {who} sends it twice, two network "
            f"interfaces carry the bus, or a second {who} uses the name {robot_name}: {other}"
        )
    count_on = f"the {who} must number its messages 0, 1, 2, ..., or losses go unseen"
    how = "does not count" if kind == "stands still" else "begins again with every message"
    return f"{names}: sequence {how}; {count_on}"


def _rate(stream: NamedIdentity) -> str:
    if stream.rate_hz is None:
        return ""
    nominal = "" if stream.nominal_hz is None else f" of {stream.nominal_hz:.0f}"
    return f" ({stream.rate_hz:.0f}{nominal} Hz)"


def _speaker(channel: Channel[Any]) -> str:
    """Return in words which program speaks on a channel of the robot's side."""
    if channel.rate == "mocap":
        return "camera bridge"
    return "onboard program" if channel.publisher == ABOARD else "driver"

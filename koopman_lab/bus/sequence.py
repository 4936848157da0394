"""Counts the messages that a stream lost, by the gaps in its sequence numbers."""

from __future__ import annotations

from typing import NamedTuple

LATEST = 64
"""A message that so many have overtaken counts as lost."""
MOST_OTHER_PUBLISHERS = 7
"""Publishers of one stream beside the newest; one more, and the oldest is forgotten."""
SMALLEST_SPLIT_GAP = 4
"""A message is overtaken by fewer: whoever goes on before such a gap is another publisher."""
LARGEST_GAP = 10**9
"""Whoever is farther ahead is another publisher: the cameras, the fastest of all, take 48 days to
say so much, and nobody listens so long without a message."""


class Gap(NamedTuple):
    """What looked like a loss: the publisher, what it would have said, said instead, and lost."""

    publisher: int
    expected: int
    sequence: int
    lost: int


class SequenceCounter:
    """Counts missing messages of one stream.

    A message that was overtaken is missing until it comes; the newest number once more is a
    repetition; any other number lower than expected, or ahead of it by more than
    :data:`LARGEST_GAP`, is a publisher that started, again or beside the one before. Where several
    speak, as the loggers of two commands do, a number belongs to the publisher that it follows most
    closely. One that is heard first after a younger one looks like a loss, until the younger goes
    on where it was.
    """

    def __init__(self) -> None:
        self.lost = 0
        self.restarts = 0
        self.publisher = 0
        """Number of the newest message's publisher, counted from 0 in order of their starts."""
        self.newest_split: tuple[int, int, int] | None = None
        """The newest gap that turned out to be a second publisher's start: its first number, the
        publisher to whom its messages were counted, and the one whose they are."""
        self._next: int | None = None
        self._others: list[tuple[int, int]] = []
        """The number that each other publisher would send next, and the publisher; newest last."""
        self._missing: set[int] = set()
        self._gap: Gap | None = None
        """The newest of at least :data:`APART`."""

    def update(self, sequence: int) -> int:
        """Take the next received number; return how many were missing just before it."""
        if sequence == self._next:
            self._next = sequence + 1
            return 0
        if self._gap is not None and sequence == self._gap.expected:
            self._tell_apart(self._gap)
            return 0
        if sequence in self._missing:
            self._missing.discard(sequence)
            self.lost -= 1
            # Overtaken: what goes on beside another begins with what was expected.
            self._gap = None
            return 0
        if self._others:
            self._turn_to_closest(sequence)
        expected = sequence if self._next is None else self._next
        if sequence == expected - 1:
            return 0
        gap = max(0, sequence - expected)
        if 0 < gap <= LARGEST_GAP:
            oldest = sequence - LATEST
            self._missing = {number for number in self._missing if number >= oldest}
            self._missing.update(range(max(expected, oldest), sequence))
            if gap >= SMALLEST_SPLIT_GAP:
                self._gap = Gap(self.publisher, expected, sequence, gap)
        elif gap or sequence < expected:
            gap = 0
            self._others = [*self._others[-MOST_OTHER_PUBLISHERS + 1 :], (expected, self.publisher)]
            self.restarts += 1
            self.publisher = self.restarts
            self._missing.clear()
            self._gap = None
        self._next = sequence + 1
        self.lost += gap
        return gap

    def _tell_apart(self, gap: Gap) -> None:
        """Make two publishers of the one that spoke before a gap and now goes on there."""
        assert self._next is not None
        self.restarts += 1
        later_publisher = self.restarts
        others = [*self._others, (self._next, self.publisher)]
        self._others = [
            (n, later_publisher if publisher == gap.publisher else publisher)
            for n, publisher in others
        ]
        self._others = self._others[-MOST_OTHER_PUBLISHERS:]
        self._next, self.publisher = gap.expected + 1, gap.publisher
        before_gap = range(gap.expected, gap.sequence)
        self._missing = {number for number in self._missing if number not in before_gap}
        self.lost -= gap.lost
        self.newest_split = gap.sequence, gap.publisher, later_publisher
        self._gap = None

    def _turn_to_closest(self, sequence: int) -> None:
        """Make that publisher the present one whose next number is closest below, or this."""
        assert self._next is not None
        present = self._next, self.publisher
        candidates = [other for other in (*self._others, present) if other[0] - 1 <= sequence]
        if not candidates:
            return
        closest = max(candidates)
        if closest != present:
            self._others = [other for other in self._others if other != closest]
            self._others.append(present)
            self._next, self.publisher = closest

"""Counts the messages that a stream lost, by the gaps in its sequence numbers."""

from __future__ import annotations

from typing import NamedTuple

LATEST = 64
"""A message that so many have overtaken counts as lost. Of so many the copies are known; a power
of two."""
MOST_OTHER_PUBLISHERS = 7
"""Publishers of one stream beside the newest; one more, and the oldest is forgotten."""
SMALLEST_SPLIT_GAP = 4
"""A message is overtaken by fewer: whoever goes on before such a gap is another publisher."""
LARGEST_GAP = 10**9
"""Whoever is farther ahead is another publisher: the cameras, the fastest of all, take 48 days to
say so much, and nobody listens so long without a message."""
PLACE = LATEST - 1
"""What leaves of a number its place among the :data:`LATEST`."""


class Gap(NamedTuple):
    """What looked like a loss: the publisher, what it would have said, said instead, and lost."""

    publisher: int
    expected: int
    sequence: int
    lost: int


class SequenceCounter:
    """Counts missing messages of one stream.

    A message that was overtaken is missing until it comes. One that comes once more, with the
    number and the time that it had, is a copy and says nothing. Any other number lower than
    expected, or ahead of it by more than :data:`LARGEST_GAP`, is a publisher that started, again or
    beside the one before. Where several speak, as the loggers of two commands do, a number belongs
    to the publisher that would send it next, or else to that which it follows most closely. One
    that is heard first after a younger one looks like a loss, until the younger goes on where it
    was.

    Several that started together say the same numbers, as nobody does alone: two numbers near each
    other that another message has as well are a second publisher. One number said again and again
    is a publisher that does not count.
    """

    def __init__(self) -> None:
        self.lost = 0
        self.restarts = 0
        self.publisher = 0
        """Number of the newest message's publisher, counted from 0 in order of their starts."""
        self.newest_split: tuple[int, int, int] | None = None
        """The newest gap that turned out to be a second publisher's start: its first number, the
        publisher to whom its messages were counted, and the one whose they are."""
        self.copies = 0
        self.next_number: int | None = None
        """Number of the message that would come next if none were lost."""
        self._others: list[tuple[int, int]] = []
        """The number that each other publisher would send next, and the publisher; newest last."""
        self._missing: set[int] = set()
        self._gap: Gap | None = None
        """The newest of at least :data:`SMALLEST_SPLIT_GAP`."""
        self.stamps: list[int | None] = [None] * LATEST
        """When the newest message of each place was stamped (us)."""
        self._copied: list[int | None] = [None] * LATEST
        """When the newest message of each place that came again was stamped (us)."""
        self._shared: int | None = None
        """The newest number that another message had as well, without being its copy."""
        self._others_of_shared = 0

    def update(self, sequence: int, utime: int) -> int:
        """Take the next received number; return how many were missing just before it.

        Parameters
        ----------
        sequence
            The message's number.
        utime
            When its sender stamped it (us); tells its copies from others of the same number.
        """
        if sequence == self.next_number:
            self.next_number = sequence + 1
            self.stamps[sequence & PLACE] = utime
            return 0
        place = sequence & PLACE
        if self.stamps[place] == utime:
            self.copies += 1
            self._copied[place] = utime
            return 0
        self.stamps[place] = utime
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
        expected = sequence if self.next_number is None else self.next_number
        if sequence == expected - 1 and not self._is_said_by_two(sequence):
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
        self.next_number = sequence + 1
        self.lost += gap
        return gap

    @property
    def stands_still(self) -> bool:
        """Return whether the newest number came more often than all publishers could say it."""
        return (
            self._shared is not None
            and self.next_number == self._shared + 1
            and self._others_of_shared > MOST_OTHER_PUBLISHERS
        )

    def newest_times(self, count: int) -> list[int | None]:
        """Return when the newest numbers of the newest publisher were stamped (us).

        Newest first, at most :data:`LATEST`; None for each that was not heard.
        """
        return [self.stamps[place] for place in self._newest_places(count)]

    def share_copied(self, count: int) -> float:
        """Return which share of so many newest numbers came more than once, as copies."""
        if not self.copies:
            return 0.0
        times, copied, places = self.stamps, self._copied, self._newest_places(count)
        return (
            sum(times[place] is not None and times[place] == copied[place] for place in places)
            / count
        )

    def _newest_places(self, count: int) -> list[int]:
        following = self.next_number or 0
        return [(following - 1 - k) & PLACE for k in range(count)]

    def _is_said_by_two(self, sequence: int) -> bool:
        """Take a number that another message had just before; return whether a publisher begins."""
        before = self._shared
        if sequence == before:
            self._others_of_shared += 1
            return False
        self._shared, self._others_of_shared = sequence, 1
        return before is not None and 0 < sequence - before <= LATEST

    def _tell_apart(self, gap: Gap) -> None:
        """Make two publishers of the one that spoke before a gap and now goes on there."""
        assert self.next_number is not None
        self.restarts += 1
        later_publisher = self.restarts
        others = [*self._others, (self.next_number, self.publisher)]
        self._others = [
            (n, later_publisher if publisher == gap.publisher else publisher)
            for n, publisher in others
        ]
        self._others = self._others[-MOST_OTHER_PUBLISHERS:]
        self.next_number, self.publisher = gap.expected + 1, gap.publisher
        before_gap = range(gap.expected, gap.sequence)
        self._missing = {number for number in self._missing if number not in before_gap}
        self.lost -= gap.lost
        self.newest_split = gap.sequence, gap.publisher, later_publisher
        self._gap = None

    def _turn_to_closest(self, sequence: int) -> None:
        """Make the present one who would say this next, or else follows it most closely."""
        assert self.next_number is not None
        present = self.next_number, self.publisher
        candidates = [other for other in (*self._others, present) if other[0] - 1 <= sequence]
        if not candidates:
            return
        closest = min(candidates, key=lambda other: _remoteness(sequence - other[0], other[1]))
        if closest != present:
            self._others = [other for other in self._others if other != closest]
            self._others.append(present)
            self.next_number, self.publisher = closest


def _remoteness(ahead: int, publisher: int) -> tuple[int, int, int]:
    """Return by what to order publishers for a number so far ahead of what each would say next.

    A publisher that lost a few messages comes before one that would have to say a number again, and
    this one before one of whom many are missing; of equals the youngest comes first.
    """
    if ahead < 0:
        return 1, 0, -publisher
    return (0 if ahead < LATEST else 2), ahead, -publisher

"""Times that a sender can write into a stamp and no clock says, and how much work they make."""

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager

HOUR_US, DAY_US = 3_600_000_000, 86_400_000_000
SMALLEST, LARGEST = -(2**63), 2**63 - 1

HOSTILE: dict[str, Callable[[int], int]] = {
    "the largest": lambda _: LARGEST,
    "the smallest": lambda _: SMALLEST,
    "zero": lambda _: 0,
    "one before zero": lambda _: -1,
    "an hour ahead": lambda now: now + HOUR_US,
    "a day behind": lambda now: now - DAY_US,
    "seconds": lambda now: now // 1_000_000,
    "nanoseconds": lambda now: now * 1000,
    "just inside what is plausible, ahead": lambda now: now + 990_000,
    "just inside what is plausible, behind": lambda now: now - 990_000,
    "the largest that a clock can say": lambda _: 2**61,
    "the opposite": lambda now: -now,
}


class OverworkedError(AssertionError):
    """More calls than allowed."""


@contextmanager
def at_most_calls(most: int) -> Iterator[None]:
    """Let the block make so many calls of functions, Python's own included, and end it there.

    Work that no wall clock judges: the same on every machine, and a loop without end has one.
    """
    calls = 0

    def note(_, event, __):
        nonlocal calls
        if event in ("call", "c_call"):
            calls += 1
            if calls > most:
                sys.setprofile(None)
                raise OverworkedError(f"more than {most} calls")

    before = sys.getprofile()
    sys.setprofile(note)
    try:
        yield
    finally:
        sys.setprofile(before)

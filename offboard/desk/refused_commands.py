"""Whether the motor loop takes the commands that are sent to it, and only those."""

from __future__ import annotations

from collections import deque
from typing import NamedTuple

import lcmtypes
from koopman_lab.bus.age import is_current
from koopman_lab.bus.commanders import NOBODY
from koopman_lab.units import US_PER_S

LARGEST_SHARE = 0.75
"""Of the commands sent: after a hole of the radio some are refused until the robot has stopped, and
all that the radio had kept until then."""
LONGEST_GAP_US = 500_000
"""Between two status messages; what was before a hole of the radio says nothing of after it."""
FEWEST_SENT = 10
"""Of fewer nothing is said."""
MORE_THAN_SENT = 5
"""So many commands may lie between the first and the last status of a window unseen; more that
were accepted beyond those sent are another's."""
CLOCKS_TAKE = 3.0
"""So many times as long a board may find commands too old, until it knows the time again."""

_OUT_OF_ORDER, _TOO_OLD = "out of order", "too old or of the future"
_HINTS = {
    _OUT_OF_ORDER: (
        "another program sends commands under this one's number: look for it with `klab topics` "
        "and on other desks, and end it"
    ),
    "outside the limits": (
        "the onboard program has tighter limits: start both with the same --preset and --config"
    ),
    "of another type": "the onboard program drives another kind of robot: see --robot",
    _TOO_OLD: (
        "the clocks of desk and board do not agree: see TIME_SYNC in `klab topics`, and start the "
        "onboard program again"
    ),
}
"""What to do, by why commands are refused."""


class _Counts(NamedTuple):
    utime: int
    sent: int
    accepted: int
    refused: tuple[int, ...]
    """In the order of :data:`_HINTS`."""

    def since(self, before: _Counts) -> _Counts:
        refused = tuple(now - then for now, then in zip(self.refused, before.refused, strict=True))
        return _Counts(
            self.utime - before.utime,
            self.sent - before.sent,
            self.accepted - before.accepted,
            refused,
        )


class RefusedCommands:
    """Compares what is sent with what the motor loop says that it took.

    Parameters
    ----------
    commander
        Number of who sends.
    limit_s
        For so long most commands may be refused (s).

    Attributes
    ----------
    complaint
        What is wrong, in words; None as long as nothing is. Once said it stays.
    """

    def __init__(self, commander: int, limit_s: float) -> None:
        self.complaint: str | None = None
        self._commander = commander
        self._limit_us = round(limit_s * US_PER_S)
        self._longest_us = round(CLOCKS_TAKE * limit_s * US_PER_S)
        self._seen: deque[_Counts] = deque()
        self._younger: deque[_Counts] = deque()
        """Those that came within the limit."""
        self._recent: _Counts | None = None
        """The newest of the others."""

    def see(self, status: lcmtypes.onboard_status_t, sent: int, now_us: int) -> None:
        """Take a status that arrives at ``now_us``, when ``sent`` commands had been sent."""
        counts = _Counts(
            now_us,
            sent,
            status.accepted,
            (status.refused_order, status.refused_value, status.refused_type, status.refused_stale),
        )
        others = status.commander not in (NOBODY, self._commander)
        stopped = status.state in (status.ESTOP, status.FAULT)
        # Of a robot that is another's or stopped, and of a loop that counts anew, nothing is known.
        if others or stopped or (self._seen and self._begins_anew(counts)):
            self._seen.clear()
            self._younger.clear()
            self._recent = None
        self._seen.append(counts)
        self._younger.append(counts)
        while now_us - self._younger[0].utime >= self._limit_us:
            self._recent = self._younger.popleft()
        while len(self._seen) > 1 and now_us - self._seen[1].utime >= self._longest_us:
            self._seen.popleft()
        if self.complaint is None:
            self.complaint = self._judge()

    def _begins_anew(self, counts: _Counts) -> bool:
        before = self._seen[-1]
        return counts.accepted < before.accepted or not is_current(
            before.utime, counts.utime, LONGEST_GAP_US
        )

    def _judge(self) -> str | None:
        newest, oldest, recent = self._seen[-1], self._seen[0], self._recent
        if recent is not None:
            if newest.accepted - recent.accepted > newest.sent - recent.sent + MORE_THAN_SENT:
                window = newest.since(recent)
                return (
                    f"the onboard program took {window.accepted} commands in "
                    f"{window.utime / US_PER_S:.1f} s, of which this program sent {window.sent}: "
                    + _HINTS[_OUT_OF_ORDER]
                )
            if newest.refused != recent.refused:
                complaint = _complaint(newest.since(recent), _TOO_OLD)
                if complaint is not None:
                    return complaint
        if newest.utime - oldest.utime >= self._longest_us and newest.refused != oldest.refused:
            return _complaint(newest.since(oldest))
        return None


def _complaint(window: _Counts, but: str = "") -> str | None:
    """Return what to say of a time in which so many commands were refused, None if nothing.

    What is refused ``but`` for that reason is left out. Only where somebody else's commands are
    taken under this one's number are its own out of order while as many are accepted as it has
    sent; whatever else is refused beside those is noise that strangers send.
    """
    by_why = dict(zip(_HINTS, window.refused, strict=True)) | {but: 0}
    if window.accepted > (1.0 - LARGEST_SHARE) * window.sent:
        by_why = {_OUT_OF_ORDER: by_why[_OUT_OF_ORDER]}
    refused = sum(by_why.values())
    if window.sent < FEWEST_SENT or refused < LARGEST_SHARE * window.sent:
        return None
    why = max(by_why, key=lambda text: by_why[text])
    return (
        f"the onboard program refused {refused} commands in {window.utime / US_PER_S:.1f} s, in "
        f"which this program sent {window.sent}, most as {why}: {_HINTS[why]}"
    )

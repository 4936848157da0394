"""Keeps a log that is sent again off those who act on what is said now.

All of a log goes out as it was recorded, motor duties, encoder counts and orders included. Only the
times in it tell it from who speaks now; they are judged by the clock of the bus.
"""

from __future__ import annotations

from typing import Literal, Protocol

from koopman_lab.bus.age import is_current
from koopman_lab.units import US_PER_S

LOG_US = 5 * US_PER_S
"""A message that was stamped so much earlier or later is a log's; no network takes so long."""

SAME_SENDER_US = US_PER_S
"""Stamps of one sender stray less against the clock of who hears them; no wire takes so long."""
SILENCE_US = 50_000
"""After five motor ticks without a message, any sender may be the one whose clock was set."""
GONE_US = US_PER_S
"""After so long without a message a sender with a number is gone, whatever is said since."""

Replayed = Literal["passes", "stream", "order"]
"""What becomes of a replayed message where somebody acts on its channel: it passes, because who
acts on it judges its age; it is passed over beside a live stream; it is passed over as an order
that is not of now."""


def from_log(utime: int, now_us: int) -> bool:
    """Return whether a message stamped ``utime`` (us), heard at ``now_us``, comes from a log."""
    return not is_current(utime, now_us, LOG_US)


class ReplayGuard(Protocol):
    """Decides what one who acts on a channel hears."""

    def accepts(self, utime: int, now_us: int) -> bool:
        """Return whether a message stamped ``utime`` (us), which arrives at ``now_us``, is live."""


class OrderGuard:
    """Passes over what a person ordered long ago, or will have ordered."""

    def accepts(self, utime: int, now_us: int) -> bool:
        """Return whether the order is of now; times in us."""
        return not from_log(utime, now_us)


class StreamGuard:
    """Follows one sender of a stream, as on a wire, where nobody but the other end can speak.

    A sender is known by how far its stamps lie from the clock of the bus. Another one is followed
    if its stamps lie nearer, since a log is never of now, or if the stream has fallen silent, since
    then the sender's clock was set.
    """

    def __init__(self) -> None:
        self._ahead_us: int | None = None
        """How far the stamps of the sender lie ahead."""
        self._heard_us = 0

    def accepts(self, utime: int, now_us: int) -> bool:
        """Return whether a message is the sender's.

        Parameters
        ----------
        utime
            When the message was stamped (us), by its sender's clock.
        now_us
            Present time of the bus (us).
        """
        ahead_us, known_us = utime - now_us, self._ahead_us
        # Of a steady sender, which most are, nothing is to be judged.
        if (
            ahead_us != known_us
            and known_us is not None
            and not (
                is_current(ahead_us, known_us, SAME_SENDER_US)
                or abs(ahead_us) < abs(known_us)
                or now_us - self._heard_us >= SILENCE_US
            )
        ):
            return False
        self._ahead_us, self._heard_us = ahead_us, now_us
        return True


class SignedStreamGuard:
    """Follows one sender of a stream whose messages carry the lab's key, by the sender's number.

    What was recorded carries the number of a program that has ended. It is no stream to turn to
    just because the one that is followed comes late, as it may on a busy machine.
    """

    def __init__(self) -> None:
        self._sender: bytes | None = None
        self._is_of_now, self._heard_us = False, 0

    def accepts(self, sender: bytes, utime: int, now_us: int) -> bool:
        """Return whether a message is of the sender that is followed, or another one is from now.

        Parameters
        ----------
        sender
            Number of the message's sender.
        utime
            When the message was stamped (us), by its sender's clock.
        now_us
            Present time of the bus (us).
        """
        is_of_now = is_current(utime, now_us, SAME_SENDER_US)
        if sender != self._sender and self._sender is not None:
            # A log is never of now, so who is may be believed to be there instead.
            patience_us = 0 if not self._is_of_now else SILENCE_US
            if now_us - self._heard_us < (patience_us if is_of_now else GONE_US):
                return False
        self._sender, self._is_of_now, self._heard_us = sender, is_of_now, now_us
        return True


def guard_of(replayed: Replayed) -> ReplayGuard | None:
    """Return a guard for one subscription; None where what is replayed passes."""
    if replayed == "passes":
        return None
    return StreamGuard() if replayed == "stream" else OrderGuard()

"""Whether a message is of now, by its stamp and by when it was new: the one judgement of age."""

from __future__ import annotations


def is_current(stamped_us: int, now_us: int, limit_us: float) -> bool:
    """Return whether a time lies within ``limit_us`` of now, before or after it.

    What seems to come from the future is no younger for it: its sender's clock is wrong, or it is
    a log of a machine whose clock was.

    Parameters
    ----------
    stamped_us, now_us
        Times of one clock (us).
    limit_us
        Largest distance between them (us).
    """
    return abs(now_us - stamped_us) <= limit_us


def is_fresh(stamped_us: int, new_us: int, now_us: int, limit_us: float) -> bool:
    """Return whether what is said is of now, and was new not long ago.

    A stamp that is repeated, and one that lies ahead of its time, look as if they were of now for
    longer than they are; that a *new* one was heard is judged by the clock of who listens.

    Parameters
    ----------
    stamped_us
        Newest stamp (us), by the sender's clock.
    new_us
        When the first message with this stamp was heard (us).
    now_us
        Present time (us).
    limit_us
        Largest distance of both from now (us).
    """
    return is_current(stamped_us, now_us, limit_us) and is_current(new_us, now_us, limit_us)

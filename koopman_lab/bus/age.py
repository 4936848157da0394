"""Whether a message is of now, by its stamp: the one judgement of age."""

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

"""A state as a person reads it: a word, a tone, for which the page has a colour, and more of it."""

from __future__ import annotations

from typing import NamedTuple

IDLE, ACTIVE, GOOD, WARN, BAD = "idle", "active", "good", "warn", "bad"
GONE, REPLAY = "gone", "replay"
TONES = (IDLE, ACTIVE, GOOD, WARN, BAD, GONE, REPLAY)
"""Nothing happens; something does; it went well; it did not; somebody must look; nobody speaks; a
log speaks."""


class StateInWords(NamedTuple):
    """A state, of a robot or of a run.

    Attributes
    ----------
    word
        What is done, or how it ended: parking, parked, not parked, stopped, ...
    tone
        One of :data:`TONES`.
    detail
        More of it, in words; empty where there is no more.
    """

    word: str
    tone: str
    detail: str = ""

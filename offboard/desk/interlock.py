"""Why the robot must not be driven, and whether that passes by itself."""

from __future__ import annotations

from typing import NamedTuple


class Interlock(NamedTuple):
    """Something without which the robot must not be driven is missing.

    Attributes
    ----------
    reason
        In words.
    lasting
        Whether a person has to act. Everything else, silence above all, may pass by itself.
    """

    reason: str
    lasting: bool = False

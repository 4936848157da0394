"""What one look of `klab doctor` brings."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Finding:
    """One look at the machine; ``remedy`` is empty where nothing is to be mended."""

    what: str
    detail: str
    good: bool
    needed: bool = True
    remedy: str = ""
    bad: str = "MISSING"
    """In a word, where it is needed and not good."""
    lacking: str = "missing, not needed"
    """In a word or two, where it is not needed and not good."""

"""Verdicts on claims: rules that judge numbers, and say in words how."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from enum import Enum
from typing import Protocol


class Verdict(str, Enum):
    """How a claim stands; the last one where a number is missing."""

    HOLDS = "holds"
    WEAKER = "holds weaker"
    NOT = "does not hold"
    UNKNOWN = "not measured"


class Rule(Protocol):
    """Judges a number."""

    def judge(self, value: float) -> Verdict:
        """Return the verdict on a number; one that is not a number never holds."""

    def in_words(self, unit: str) -> str:
        """Return what it takes to hold, and to hold weaker."""


@dataclass(frozen=True)
class AtMost:
    """Holds up to ``limit``, weaker up to ``weaker``."""

    limit: float
    weaker: float

    def judge(self, value: float) -> Verdict:
        """Return the verdict on a number."""
        if value <= self.limit:
            return Verdict.HOLDS
        return Verdict.WEAKER if value <= self.weaker else Verdict.NOT

    def in_words(self, unit: str) -> str:
        """Return the limits in words."""
        return _threshold_in_words("at most", self.limit, self.weaker, unit)


@dataclass(frozen=True)
class AtLeast:
    """Holds from ``limit`` on, weaker from ``weaker`` on."""

    limit: float
    weaker: float

    def judge(self, value: float) -> Verdict:
        """Return the verdict on a number."""
        if value >= self.limit:
            return Verdict.HOLDS
        return Verdict.WEAKER if value >= self.weaker else Verdict.NOT

    def in_words(self, unit: str) -> str:
        """Return the limits in words."""
        return _threshold_in_words("at least", self.limit, self.weaker, unit)


@dataclass(frozen=True)
class Near:
    """Holds within ``share`` of a printed number, weaker within a factor of it."""

    number: float
    share: float = 0.1
    factor: float = 2.0

    def judge(self, value: float) -> Verdict:
        """Return the verdict on a number."""
        if abs(value - self.number) <= self.share * self.number:
            return Verdict.HOLDS
        near = self.number / self.factor <= value <= self.number * self.factor
        return Verdict.WEAKER if near else Verdict.NOT

    def in_words(self, unit: str) -> str:
        """Return the limits in words."""
        return (
            f"within {100 * self.share:g} % of {number(self.number, unit)} "
            f"(weaker: within a factor of {self.factor:g})"
        )


@dataclass(frozen=True)
class Same:
    """Holds where the number is the printed one, as exactly as that was printed."""

    number: float
    tolerance: float = 1e-3

    def judge(self, value: float) -> Verdict:
        """Return the verdict on a number."""
        same = math.isclose(value, self.number, rel_tol=self.tolerance, abs_tol=1e-9)
        return Verdict.HOLDS if same else Verdict.NOT

    def in_words(self, unit: str) -> str:
        """Return the number in words."""
        return f"equal to {number(self.number, unit)}"


LARGE, HUGE = 1e3, 1e7
"""Numbers between them are written whole."""
ORDER = (Verdict.NOT, Verdict.UNKNOWN, Verdict.WEAKER, Verdict.HOLDS)


def worst(verdicts: Iterable[Verdict]) -> Verdict:
    """Return the verdict on a claim of several parts: that on its weakest."""
    return min(verdicts, key=ORDER.index)


def number(value: float, unit: str) -> str:
    """Return a number with its unit for a person to read; shares as percent."""
    if unit == "share":
        return f"{100 * value:.3g} %"
    is_whole = value.is_integer() or abs(value) >= LARGE
    text = f"{value:.0f}" if is_whole and abs(value) < HUGE else f"{value:.3g}"
    return f"{text} {unit}".rstrip()


def _threshold_in_words(how: str, limit: float, weaker: float, unit: str) -> str:
    if limit == weaker:
        return f"{how} {number(limit, unit)}"
    return f"{how} {number(limit, unit)} (weaker: {number(weaker, unit)})"

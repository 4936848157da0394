"""The form of a verdict on what was recorded or learned: good, weak or unusable, and why."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass
from typing import Any, Literal, get_args

Level = Literal["good", "weak", "unusable"]
LEVELS: tuple[Level, ...] = get_args(Level)
"""From the best to the worst."""


@dataclass(frozen=True)
class Reason:
    """One thing that is wrong.

    Attributes
    ----------
    level
        What it makes of the whole; a remark is ``good``.
    text
        In words: what was seen, what is likely to have caused it, and the next step.
    """

    level: Level
    text: str


@dataclass(frozen=True)
class Verdict:
    """What is made of a session, a data set or a model.

    Attributes
    ----------
    level
        ``good``; ``weak``, which works, but not as well as it could; or ``unusable``, from which
        nothing that drives a robot should be made.
    reasons
        The worst first.
    figures
        The numbers behind it, by name; JSON.
    """

    level: Level
    reasons: tuple[Reason, ...]
    figures: Mapping[str, Any]

    @property
    def usable(self) -> bool:
        """Return whether it is good or weak."""
        return self.level != "unusable"

    @property
    def text(self) -> str:
        """Return the level and the reasons for it as one line."""
        decisive = [reason.text for reason in self.reasons if reason.level == self.level]
        return f"{self.level}: {'; '.join(decisive)}" if decisive else self.level

    def as_dict(self) -> dict[str, Any]:
        """Return the verdict as JSON can hold it."""
        return asdict(self) | {"figures": dict(self.figures)}


def from_dict(stored: Mapping[str, Any]) -> Verdict:
    """Return the verdict that :meth:`Verdict.as_dict` made this of; figures may be left out."""
    reasons = tuple(Reason(reason["level"], reason["text"]) for reason in stored["reasons"])
    return Verdict(stored["level"], reasons, stored.get("figures", {}))


def verdict(reasons: Iterable[Reason], figures: Mapping[str, Any]) -> Verdict:
    """Return the verdict that reasons come to: as bad as the worst of them."""
    ordered = tuple(sorted(reasons, key=lambda reason: -LEVELS.index(reason.level)))
    return Verdict(ordered[0].level if ordered else "good", ordered, figures)


def together(**parts: Verdict) -> Verdict:
    """Return the verdict on what has parts, such as a session and its data, by their names."""
    return verdict(
        [reason for part in parts.values() for reason in part.reasons],
        {name: part.figures for name, part in parts.items()},
    )

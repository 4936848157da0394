"""The one table of what the page can start: which command, and what a person chooses for it.

The page's forms, the check of what a page sends, and the command's arguments derive from it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any, NamedTuple

from koopman_lab.errors import LabStateError

LARGEST_SEED = 2**31 - 1
LARGEST_NUMBER = 1e12
"""Of a number without bounds; whoever gets it refuses what it cannot use."""


class Choice(NamedTuple):
    """One of the values that a field offers.

    Attributes
    ----------
    value
        What the command is given.
    label
        What a person reads.
    robot
        Kind of the robot that it is for; empty where it fits any.
    """

    value: str
    label: str
    robot: str = ""


Offers = Mapping[str, Sequence[Choice]]
"""What can be chosen now, by the source that fields name."""


@dataclass(frozen=True)
class Field:
    """One thing to choose.

    Attributes
    ----------
    name
        In what the page sends.
    label
        With the unit of a number.
    flag
        Of the command; empty for its argument.
    source
        From which offers it is chosen; empty for numbers.
    numbers
        How many numbers it takes.
    low, high
        Their bounds.
    whole
        Whether they are whole numbers.
    required
        Whether it cannot be left to the command's default.
    """

    name: str
    label: str
    flag: str
    source: str = ""
    numbers: int = 1
    low: float = -math.inf
    high: float = math.inf
    whole: bool = False
    required: bool = False

    def words(self, value: Any, offers: Offers) -> list[str]:
        """Return the arguments for a value that a page sent, without the flag.

        Raises
        ------
        LabStateError
            If it is none of the choices, or no number within the bounds.
        """
        if self.source:
            if not any(value == choice.value for choice in offers.get(self.source, ())):
                raise LabStateError(
                    f"{self.label}: {str(value)[:64]!r} is not offered (any more); choose again"
                )
            return [value]
        values = value if isinstance(value, list) else [value]
        if len(values) != self.numbers or not all(map(self._fits, values)):
            kind = "whole number" if self.whole else "number"
            count = f"{self.numbers} {kind}s" if self.numbers > 1 else f"a {kind}"
            bounds = f" from {self.low:g} to {self.high:g}" if math.isfinite(self.low) else ""
            raise LabStateError(f"{self.label}: expected {count}{bounds}")
        return [f"{number:d}" if self.whole else f"{float(number)!r}" for number in values]

    def _fits(self, value: Any) -> bool:
        types: tuple[type, ...] = (int,) if self.whole else (int, float)
        if type(value) not in types or not self.low <= value <= self.high:
            return False
        return bool(abs(value) <= LARGEST_NUMBER)


@dataclass(frozen=True)
class Task:
    """One command.

    Attributes
    ----------
    name
        As in ``klab NAME``.
    label
        What a person reads.
    about
        What it does, in a sentence.
    drives
        Whether it drives a robot.
    fields
        What is chosen.
    """

    name: str
    label: str
    about: str
    drives: bool
    fields: tuple[Field, ...]

    def arguments(self, values: Mapping[str, Any], offers: Offers) -> list[str]:
        """Return the command's arguments for the values that a page sent.

        Raises
        ------
        LabStateError
            If one is missing, unknown or not allowed.
        """
        unknown = set(values) - {field.name for field in self.fields}
        if unknown:
            raise LabStateError(f"{self.label}: takes no {sorted(unknown)[0][:32]!r}")
        options: list[str] = []
        operands: list[str] = []
        for field in self.fields:
            value = values.get(field.name)
            if value is None:
                if field.required:
                    raise LabStateError(f"{self.label}: choose the {field.label.lower()} first")
                continue
            words = field.words(value, offers)
            if field.flag:
                options += [field.flag, *words]
            else:
                operands += words
        return [self.name, *options, *operands]

    def as_json(self) -> dict[str, Any]:
        """Return what the page makes its form of."""
        fields = []
        for field in self.fields:
            row = asdict(field)
            for bound in ("low", "high"):
                row[bound] = row[bound] if math.isfinite(row[bound]) else None
            fields.append(row)
        return {
            "name": self.name,
            "label": self.label,
            "about": self.about,
            "drives": self.drives,
            "fields": fields,
        }


_ROBOT = Field("robot", "Robot", "--robot-name", "robots", required=True)
_KIND = Field("kind", "Kind", "--robot", "kinds", required=True)
_PRESET = Field("preset", "Simulated", "--preset", "presets")
_SEED = Field("seed", "Seed", "--seed", low=0, high=LARGEST_SEED, whole=True)
_COST = Field("cost", "Cost", "--cost", "costs")

TASKS = {
    task.name: task
    for task in (
        Task(
            "park",
            "Park",
            "Drives the robot to the goal with a model.",
            drives=True,
            fields=(
                _ROBOT,
                Field("model", "Model", "--model", "models", required=True),
                _COST,
                Field("goal", "Goal: x1 (m), x2 (m), heading (°)", "--goal", numbers=3),
                _PRESET,
                _SEED,
            ),
        ),
        Task(
            "calibrate",
            "Calibrate",
            "Drives segments under each basis input and records them, for training.",
            drives=True,
            fields=(
                _ROBOT,
                _KIND,
                Field(
                    *("segments", "Segments per input", "--segments"),
                    low=1,
                    high=1000,
                    whole=True,
                ),
                _PRESET,
                _SEED,
            ),
        ),
        Task(
            "train",
            "Train",
            "Fits a model to a recorded calibration.",
            drives=False,
            fields=(
                Field("session", "Session", "", "sessions", required=True),
                Field("dictionary", "Dictionary", "--dictionary", "dictionaries"),
            ),
        ),
        Task(
            "reference",
            "Reference",
            "Drives a shape again and again in open loop, to validate models with.",
            drives=True,
            fields=(
                _ROBOT,
                _KIND,
                Field("shape", "Shape", "--shape", "shapes", required=True),
                Field("runs", "Runs", "--runs", low=1, high=1000, whole=True),
                _PRESET,
                _SEED,
            ),
        ),
        Task(
            "replay",
            "Replay",
            "Sends a recorded log again; nothing is driven.",
            drives=False,
            fields=(
                Field("log", "Log", "", "logs", required=True),
                Field("speed", "Speed (times as fast)", "--speed", low=0.1, high=100),
            ),
        ),
    )
}
"""By name, in the order of the page."""

"""Kinds of values that a configuration holds, and the base of its sections."""

from __future__ import annotations

from typing import Annotated

from pydantic import AfterValidator, BaseModel, ConfigDict, Field

Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
NotNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Share = Annotated[float, Field(ge=0, le=1)]
Finite = Annotated[float, Field(allow_inf_nan=False)]
Pair = tuple[Finite, Finite]
Input = tuple[Finite, ...]
"""An input: as many numbers as the robot has inputs."""
InputBounds = tuple[Positive, ...]
"""Magnitudes or weights of inputs, one for each."""


def _ordered(low_high: tuple[float, float]) -> tuple[float, float]:
    if low_high[0] >= low_high[1]:
        raise ValueError("expected [low, high] with low < high")
    return low_high


Range = Annotated[tuple[Finite, Finite], AfterValidator(_ordered)]
SpanFromZero = Annotated[tuple[NotNegative, NotNegative], AfterValidator(_ordered)]
Triple = tuple[Finite, Finite, Finite]


class Section(BaseModel):
    """Base of all sections: frozen, and without unknown keys."""

    model_config = ConfigDict(frozen=True, extra="forbid")

"""Kinds of values that a configuration holds, and the base of its sections.

Each kind has a unit and bounds that only a slip crosses. What guards the robot has narrower ones,
which stand at its field, with the reason.
"""

from __future__ import annotations

from typing import Annotated

from pydantic import AfterValidator, BaseModel, ConfigDict, Field

from koopman_lab.config.bounds import Bounds

DAY_S = 86_400.0
FULL_TURN_RAD = 6.2832
NARROWEST = 1e-6
"""Between the ends of a range, in its unit."""
NO_CAMERAS = "no cameras see so far, and a floor of that size would keep nothing on it"

Finite = Annotated[float, Field(allow_inf_nan=False)]
Share = Annotated[float, Field(ge=0, le=1)]
NotNegative = Annotated[Finite, Field(ge=0), Bounds(0.0, 1e6)]
"""A number without a unit of its own, that may be 0."""
Positive = Annotated[Finite, Field(gt=0), Bounds(1e-6, 1e6)]

Seconds = Annotated[Finite, Field(ge=0), Bounds(0.0, DAY_S, "s")]
"""A time that may be 0."""
Duration = Annotated[Finite, Field(gt=0), Bounds(1e-3, DAY_S, "s")]
Rate = Annotated[Finite, Field(gt=0), Bounds(0.01, 1e4, "Hz")]
Metres = Annotated[Finite, Field(gt=0), Bounds(1e-5, 100.0, "m")]
Radians = Annotated[Finite, Field(gt=0), Bounds(1e-5, FULL_TURN_RAD, "rad")]
NoiseM = Annotated[Finite, Field(ge=0), Bounds(0.0, 1.0, "m")]
"""A spread of positions, none included."""
NoiseRad = Annotated[Finite, Field(ge=0), Bounds(0.0, FULL_TURN_RAD, "rad")]
Speed = Annotated[Finite, Field(gt=0), Bounds(1e-3, 10.0, "m/s")]
TurnSpeed = Annotated[Finite, Field(gt=0), Bounds(1e-3, 100.0, "rad/s")]
Acceleration = Annotated[Finite, Field(gt=0), Bounds(1e-3, 100.0, "m/s2")]
TurnAcceleration = Annotated[Finite, Field(gt=0), Bounds(1e-3, 1000.0, "rad/s2")]
Counting = Annotated[int, Field(ge=1), Bounds(1, 1_000_000)]
"""A whole number of things, at least one."""

TrackingTimeout = Annotated[
    Finite,
    Field(gt=0),
    Bounds(
        *(0.01, 1.0, "s", "the cameras' own latency is no loss of tracking"),
        "a robot at full speed would roll 0.6 m blind",
    ),
]
"""Age over which a camera frame counts for nothing."""

Coordinate = Annotated[Finite, Bounds(-100.0, 100.0, "m", NO_CAMERAS, NO_CAMERAS)]
Angle = Annotated[Finite, Bounds(-1000.0, 1000.0, "rad")]
PoseValues = tuple[Coordinate, Coordinate, Angle]
"""A pose (m, m, rad)."""
Offset = Annotated[Finite, Bounds(-1.0, 1.0, "m")]
OffsetPose = tuple[Offset, Offset, Annotated[Finite, Bounds(-FULL_TURN_RAD, FULL_TURN_RAD, "rad")]]
"""Where something sits on a robot (m, m, rad)."""
Input = tuple[Annotated[Finite, Bounds(-1000.0, 1000.0)], ...]
"""An input: as many numbers as the robot has inputs."""
InputBounds = tuple[Positive, ...]
"""Magnitudes or weights of inputs, one for each."""


def _ordered(low_high: tuple[float, float]) -> tuple[float, float]:
    if low_high[0] >= low_high[1]:
        raise ValueError("expected [low, high] with low < high")
    if low_high[1] - low_high[0] < NARROWEST:
        raise ValueError(f"expected [low, high] at least {NARROWEST:g} apart")
    return low_high


Extent = Annotated[tuple[Coordinate, Coordinate], AfterValidator(_ordered)]
"""A side of a rectangle on the floor (m)."""
Range = Annotated[tuple[Angle, Angle], AfterValidator(_ordered)]
_Speed = Annotated[Finite, Bounds(-10.0, 10.0, "m/s")]
_TurnSpeed = Annotated[Finite, Bounds(-100.0, 100.0, "rad/s")]
SpeedRange = Annotated[tuple[_Speed, _Speed], AfterValidator(_ordered)]
TurnSpeedRange = Annotated[tuple[_TurnSpeed, _TurnSpeed], AfterValidator(_ordered)]
SpanFromZero = Annotated[tuple[Seconds, Seconds], AfterValidator(_ordered)]


class Section(BaseModel):
    """Base of all sections: frozen, and without unknown keys."""

    model_config = ConfigDict(frozen=True, extra="forbid")

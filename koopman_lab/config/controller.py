"""The section of the predictive controller.

What each value means, its unit and where it comes from is said in ``defaults/*.yaml``.
"""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import AfterValidator, Field

from koopman_lab.config.bounds import Bounds
from koopman_lab.config.cost_table import known_cost
from koopman_lab.config.values import (
    Counting,
    Duration,
    Finite,
    InputBounds,
    NotNegative,
    Radians,
    Seconds,
    Section,
    Speed,
    TrackingTimeout,
    TurnSpeed,
)

ParkedM = Annotated[
    Finite,
    Field(gt=0),
    Bounds(1e-4, 1.0, "m", "cameras see nothing so small", "a robot so far away is not parked"),
]

CostName = Annotated[str, AfterValidator(known_cost)]
"""A row of the table of costs."""


BackEnd = Literal["ddp", "fatrop", "ipopt"]
"""Names of the solvers of the optimal control problem."""


class Weights(Section):
    """Diagonal weights of one stage cost: q for states (``ds``: observables), r for inputs.

    A single weight in the q of ``ds`` is that of every observable.
    """

    q: Annotated[tuple[NotNegative, ...], Field(min_length=1)]
    r: InputBounds


class OffsetFree(Section):
    """What takes the steady error of a model out of the plans."""

    enabled: bool
    time_constant_s: Annotated[Duration, Bounds(0.01, 1000.0, "s")]
    largest_m_per_s: Speed
    largest_rad_per_s: TurnSpeed


class Controller(Section):
    """The predictive controller."""

    dt_s: Annotated[
        Duration,
        Bounds(
            *(0.002, 0.5, "s", "no solver is so fast"),
            "the robot would be driven for so long by one look",
        ),
    ]
    horizon: Annotated[int, Field(ge=1, le=1000)]
    cost: CostName
    predict: Literal["koopman", "nominal"]
    reprojection: bool
    solver: BackEnd
    use_compiler: bool
    offset_free: OffsetFree
    u_max: InputBounds
    speed_max: InputBounds | None
    weights: dict[CostName, Weights]
    parked_position_m: tuple[ParkedM, ParkedM]
    parked_angle_rad: Annotated[
        Radians, Bounds(1e-4, 3.1416, "rad", "cameras see no angle so small", "that is any angle")
    ]
    parked_hold_s: Annotated[Seconds, Bounds(0.0, 3600.0, "s")]
    time_limit_s: Annotated[
        Duration,
        Bounds(
            *(0.05, 3600.0, "s", "no drive ends so soon"),
            "a robot that does not arrive would be driven for so long",
        ),
    ]
    tracking_timeout_s: TrackingTimeout
    pause_limit_s: Annotated[
        Seconds, Bounds(0.0, 600.0, "s", too_much="the robot would set off when nobody expects it")
    ]
    largest_failures_in_a_row: Annotated[
        Counting, Bounds(1, 100, "", too_much="the robot would be driven by old plans for so long")
    ]

"""The section of the calibration session, and the sets that it draws from and stays in.

What each value means, its unit and where it comes from is said in ``defaults/*.yaml``.
"""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from koopman_lab.config.bounds import Bounds
from koopman_lab.config.values import (
    Acceleration,
    Counting,
    Duration,
    Extent,
    Input,
    Metres,
    Radians,
    Range,
    Seconds,
    Section,
    Speed,
    SpeedRange,
    TrackingTimeout,
    TurnAcceleration,
    TurnSpeed,
    TurnSpeedRange,
)


class Area(Section):
    """A rectangle in the inertial frame, each side as [low, high]."""

    x1_m: Extent
    x2_m: Extent


class StateSet(Area):
    """A box of poses and velocities, each as [low, high]."""

    theta_rad: Range
    v_m_per_s: SpeedRange
    omega_rad_per_s: TurnSpeedRange


class Sampler(Section):
    """The calibration session."""

    segments_per_basis: Counting
    basis_inputs: Annotated[tuple[Input, ...], Field(min_length=1)]
    draw_set: StateSet
    admissible_set: StateSet
    smallest_steps: Counting
    largest_steps: Annotated[Counting, Bounds(1, 100_000)]
    drive_speed_m_per_s: Speed
    turn_speed_rad_per_s: TurnSpeed
    acceleration_m_per_s2: Acceleration
    turn_acceleration_rad_per_s2: TurnAcceleration
    position_tolerance_m: Metres
    angle_tolerance_rad: Radians
    settle_s: Seconds
    phase_time_limit_s: Annotated[
        Duration,
        Bounds(
            *(0.1, 600.0, "s", "no phase is done so soon"),
            "a robot that does not obey would be driven for so long",
        ),
    ]
    tracking_timeout_s: TrackingTimeout
    wait_limit_s: Annotated[
        Duration, Bounds(0.1, 3600.0, "s", too_much="nobody waits so long for what does not come")
    ]
    largest_redraws_in_a_row: Annotated[
        Counting, Bounds(1, 1000, "", too_much="the robot would drive all day in vain")
    ]

    @property
    def indexed_inputs(self) -> dict[int, Input]:
        """The basis inputs by their index in the paper.

        As many as an input has numbers are u_1, u_2, ... of a driftless robot, whose M_0 is the
        identity; one more, and they begin with u_0.
        """
        m = len(self.basis_inputs[0])
        return dict(enumerate(self.basis_inputs, start=1 + m - len(self.basis_inputs)))

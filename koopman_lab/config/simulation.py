"""The section of what is simulated: radio, board clock, cameras, faults, and the plant itself.

A lab with a real robot has none of it. What each value means, its unit and where it comes from is
said in ``defaults/*.yaml``.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Literal

from pydantic import Field, model_validator

from koopman_lab.config.fault_kinds import FAULT_KINDS, FaultKind
from koopman_lab.config.values import (
    Finite,
    NotNegative,
    Pair,
    Positive,
    Section,
    Share,
    SpanFromZero,
    Triple,
)


class RadioLink(Section):
    """One direction of the radio; shares are of messages."""

    delay_s: NotNegative
    jitter_s: NotNegative
    loss: Share
    duplication: Share
    reordering: Share
    held_back_s: NotNegative
    burst_rate_hz: NotNegative
    burst_s: NotNegative


class Radio(Section):
    """The radio between desk and robot, each direction on its own."""

    to_robot: RadioLink
    from_robot: RadioLink


class BoardClock(Section):
    """How wrong the board's clock is against the desk's."""

    offset_s: Finite
    drift_ppm: Finite


class Cameras(Section):
    """What the cameras see, and when they say so."""

    latency_s: NotNegative
    latency_jitter_s: NotNegative
    position_noise_m: NotNegative
    angle_noise_rad: NotNegative
    marker_offset: Triple
    lost_frame_share: Share
    occlusions_per_s: NotNegative
    occlusion_s: SpanFromZero


class Fault(Section):
    """Something that goes wrong on demand; details that the kind does not have are None."""

    kind: FaultKind
    duration_s: Annotated[float, Field(ge=0)] | None = None
    wheel: Literal["both", "left", "right"] | None = None
    battery_v: Annotated[float, Field(gt=0, le=100)] | None = None
    loss: Share | None = None
    jump_s: Annotated[float, Field(ge=-1e9, le=1e9)] | None = None

    @model_validator(mode="before")
    @classmethod
    def _with_defaults(cls, values: Any) -> Any:
        if not isinstance(values, Mapping):
            return values
        known = {key: value for key, value in values.items() if value is not None}
        kind = known.get("kind")
        return {**FAULT_KINDS[kind].details, **known} if kind in tuple(FAULT_KINDS) else known

    @model_validator(mode="after")
    def _has_only_its_details(self) -> Fault:
        for detail in ("wheel", "battery_v", "loss", "jump_s"):
            if getattr(self, detail) is not None and detail not in FAULT_KINDS[self.kind].details:
                raise ValueError(f"{self.kind} has no {detail}")
        return self


class PlannedFault(Fault):
    """A fault that comes by itself."""

    at_s: NotNegative


class Motor(Section):
    """Both geared motors of the plant; pairs are (left, right), torques are those at the wheel."""

    drive: Literal["dc", "instantaneous", "linear"]
    torque_constant_n_m_per_a: Positive
    resistance_ohm: Positive
    gear_ratio: Positive
    rotor_inertia_kg_m2: NotNegative
    viscous_friction_n_m_s_per_rad: NotNegative
    coulomb_friction_n_m: tuple[NotNegative, NotNegative]
    breakaway_friction_n_m: tuple[NotNegative, NotNegative]
    gain: Pair
    command_timeout_s: Positive


class Battery(Section):
    """What the motors and the board are fed from."""

    full_v: Positive
    empty_v: Positive
    state_of_charge: Share
    capacity_ah: Positive
    resistance_ohm: NotNegative
    board_current_a: NotNegative


class Body(Section):
    """Mass, and how the real body differs from what the software believes."""

    mass_kg: Positive
    inertia_kg_m2: Positive
    centre_of_mass_ahead_m: Finite
    wheel_inertia_kg_m2: NotNegative
    wheel_radius_factor: tuple[Positive, Positive]
    track_width_factor: Positive
    slip_angle_rad_s2_per_m: NotNegative

    @model_validator(mode="after")
    def _can_exist(self) -> Body:
        smallest = self.mass_kg * self.centre_of_mass_ahead_m**2
        if self.inertia_kg_m2 < smallest:
            raise ValueError(
                f"inertia_kg_m2 about the axle's centre is {self.inertia_kg_m2}, the offset of the "
                f"centre of mass alone makes {smallest:.3g}"
            )
        return self


class Plant(Section):
    """Motors, body and encoders."""

    encoder_rate_hz: Positive
    largest_step_s: Positive
    initial_pose: Triple
    motor: Motor
    battery: Battery
    body: Body


class Simulation(Section):
    """All that stands in for hardware."""

    radio: Radio
    clock: BoardClock
    cameras: Cameras
    faults: tuple[PlannedFault, ...]
    plant: Plant

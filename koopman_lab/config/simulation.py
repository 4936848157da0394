"""The section of what is simulated: radio, board clock, cameras, faults, and the plant itself.

A lab with a real robot has none of it. What each value means, its unit and where it comes from is
said in ``defaults/*.yaml``.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Literal

from pydantic import Field, model_validator

from koopman_lab.config.bounds import Bounds
from koopman_lab.config.fault_kinds import FAULT_KINDS, FaultKind
from koopman_lab.config.values import (
    DAY_S,
    Duration,
    Finite,
    NoiseM,
    NoiseRad,
    NotNegative,
    OffsetPose,
    PoseValues,
    Positive,
    Rate,
    Seconds,
    Section,
    Share,
    SpanFromZero,
)

ANY_CLOCK_S = 4e9
"""How far a clock can be off that starts in 1970, or was set to the next century."""
Mass = Annotated[Finite, Field(gt=0), Bounds(1e-3, 1000.0, "kg")]
Inertia = Annotated[Finite, Field(gt=0), Bounds(1e-6, 1000.0, "kg m2")]
WheelInertia = Annotated[Finite, Field(ge=0), Bounds(0.0, 10.0, "kg m2")]
Torque = Annotated[Finite, Field(ge=0), Bounds(0.0, 100.0, "N m")]
Voltage = Annotated[Finite, Field(gt=0), Bounds(0.1, 100.0, "V")]
Factor = Annotated[Finite, Field(gt=0), Bounds(0.01, 100.0)]
Gain = Annotated[Finite, Bounds(-100.0, 100.0)]
Events = Annotated[Finite, Field(ge=0), Bounds(0.0, 1e4, "per s")]
Lag = Annotated[Finite, Field(ge=0), Bounds(0.0, 60.0, "s")]


class RadioLink(Section):
    """One direction of the radio; shares are of messages."""

    delay_s: Lag
    jitter_s: Lag
    loss: Share
    duplication: Share
    reordering: Share
    held_back_s: Lag
    burst_rate_hz: Events
    burst_s: Seconds


class Radio(Section):
    """The radio between desk and robot, each direction on its own."""

    to_robot: RadioLink
    from_robot: RadioLink


class BoardClock(Section):
    """How wrong the board's clock is against the desk's."""

    offset_s: Annotated[Finite, Bounds(-ANY_CLOCK_S, ANY_CLOCK_S, "s")]
    drift_ppm: Annotated[Finite, Bounds(-1000.0, 1000.0, "ppm")]


class Cameras(Section):
    """What the cameras see, and when they say so."""

    latency_s: Lag
    latency_jitter_s: Lag
    position_noise_m: NoiseM
    angle_noise_rad: NoiseRad
    marker_offset: OffsetPose
    lost_frame_share: Share
    occlusions_per_s: Events
    occlusion_s: SpanFromZero


class Fault(Section):
    """Something that goes wrong on demand; details that the kind does not have are None."""

    kind: FaultKind
    duration_s: Annotated[float, Field(ge=0)] | None = None
    wheel: Literal["both", "left", "right"] | None = None
    battery_v: Annotated[float, Field(gt=0, le=100)] | None = None
    loss: Share | None = None
    jump_s: Annotated[float, Field(ge=-ANY_CLOCK_S, le=ANY_CLOCK_S)] | None = None

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

    at_s: Annotated[Finite, Field(ge=0), Bounds(0.0, 30.0 * DAY_S, "s")]


class Motor(Section):
    """Both geared motors of the plant; pairs are (left, right), torques are those at the wheel."""

    drive: Literal["dc", "instantaneous", "linear"]
    torque_constant_n_m_per_a: Annotated[Positive, Bounds(1e-5, 100.0, "N m/A")]
    resistance_ohm: Annotated[Positive, Bounds(1e-3, 1e4, "Ohm")]
    gear_ratio: Annotated[Positive, Bounds(0.01, 1e4)]
    rotor_inertia_kg_m2: WheelInertia
    viscous_friction_n_m_s_per_rad: Torque
    coulomb_friction_n_m: tuple[Torque, Torque]
    breakaway_friction_n_m: tuple[Torque, Torque]
    gain: tuple[Gain, Gain]
    command_timeout_s: Annotated[
        Duration,
        Bounds(
            *(0.01, 1.0, "s", "duties come no faster"),
            "a robot whose board died would drive on for 0.6 m",
        ),
    ]


class Battery(Section):
    """What the motors and the board are fed from."""

    full_v: Voltage
    empty_v: Voltage
    state_of_charge: Share
    capacity_ah: Annotated[Finite, Field(gt=0), Bounds(1e-4, 1e12, "Ah")]
    resistance_ohm: Annotated[NotNegative, Bounds(0.0, 100.0, "Ohm")]
    board_current_a: Annotated[NotNegative, Bounds(0.0, 100.0, "A")]


class Body(Section):
    """Mass, and how the real body differs from what the software believes."""

    mass_kg: Mass
    inertia_kg_m2: Inertia
    centre_of_mass_ahead_m: Annotated[Finite, Bounds(-10.0, 10.0, "m")]
    wheel_inertia_kg_m2: WheelInertia
    wheel_radius_factor: tuple[Factor, Factor]
    track_width_factor: Factor
    slip_angle_rad_s2_per_m: Annotated[NotNegative, Bounds(0.0, 100.0, "rad s2/m")]

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

    encoder_rate_hz: Annotated[
        Rate,
        Bounds(
            *(10.0, 2000.0, "Hz", "the motor loop would find the encoders silent"),
            "no driver of such a robot is so fast",
        ),
    ]
    largest_step_s: Annotated[
        Finite,
        Field(gt=0),
        Bounds(
            *(1e-5, 0.1, "s", "a second would take minutes"),
            "the equations of the motors would not hold",
        ),
    ]
    initial_pose: PoseValues
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

"""The configuration of a lab: frozen models that refuse unknown keys.

What each value means, its unit and where it comes from is said in ``defaults/*.yaml``; this file
says which values are allowed.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, model_validator

RobotKind = Literal["kinematic", "dynamic"]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
NotNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Share = Annotated[float, Field(ge=0, le=1)]
Finite = Annotated[float, Field(allow_inf_nan=False)]
Pair = tuple[Finite, Finite]


def _ordered(low_high: tuple[float, float]) -> tuple[float, float]:
    if low_high[0] >= low_high[1]:
        raise ValueError("expected [low, high] with low < high")
    return low_high


Range = Annotated[tuple[Finite, Finite], AfterValidator(_ordered)]
Triple = tuple[Finite, Finite, Finite]


class Section(BaseModel):
    """Base of all sections."""

    model_config = ConfigDict(frozen=True, extra="forbid")


class Robot(Section):
    """The robot as the software believes it to be."""

    name: Annotated[str, Field(pattern=r"^[A-Z][A-Z0-9]{0,15}$")]
    kind: RobotKind
    wheel_radius_m: Positive
    track_width_m: Positive


class Bus(Section):
    """LCM."""

    url: str
    receive_buffer_bytes: Annotated[int, Field(ge=65536)]
    heartbeat_rate_hz: Positive


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
    """Between desk and robot."""

    to_robot: RadioLink
    from_robot: RadioLink


class Clock(Section):
    """The board's clock against the desk's, and how the board finds out."""

    offset_s: Finite
    drift_ppm: Finite
    ping_rate_hz: Positive
    window_s: Positive
    largest_drift_ppm: NotNegative

    @model_validator(mode="after")
    def _within_what_the_board_expects(self) -> Clock:
        if abs(self.drift_ppm) > self.largest_drift_ppm:
            raise ValueError(
                f"drift_ppm {self.drift_ppm:g} is beyond largest_drift_ppm "
                f"{self.largest_drift_ppm:g}, so that no error bound would hold"
            )
        return self


FaultKind = Literal[
    "occlusion",
    "encoder_stuck",
    "motor_stalled",
    "battery_low",
    "radio_cut",
    "burst_loss",
    "clock_jump",
]
FAULT_DETAILS: dict[str, dict[str, Any]] = {
    "occlusion": {},
    "encoder_stuck": {"wheel": "both"},
    "motor_stalled": {"wheel": "both"},
    "battery_low": {"battery_v": 6.0},
    "radio_cut": {},
    "burst_loss": {"loss": 0.5},
    "clock_jump": {"jump_s": 10.0},
}
"""What each kind of fault has besides its duration, and the defaults."""


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
        given = {key: value for key, value in values.items() if value is not None}
        kind = given.get("kind")
        return (FAULT_DETAILS.get(kind, {}) if isinstance(kind, str) else {}) | given

    @model_validator(mode="after")
    def _has_only_its_details(self) -> Fault:
        for detail in ("wheel", "battery_v", "loss", "jump_s"):
            if getattr(self, detail) is not None and detail not in FAULT_DETAILS[self.kind]:
                raise ValueError(f"{self.kind} has no {detail}")
        return self


class PlannedFault(Fault):
    """A fault that comes by itself."""

    at_s: NotNegative


class Pid(Section):
    """One wheel's speed controller; the error is in rad/s, the output is a duty in [-1, 1]."""

    proportional: NotNegative
    integral_per_s: NotNegative
    derivative_s: NotNegative
    derivative_filter_s: Positive
    feed_forward_full_duty_rad_per_s: Positive
    feed_forward_lag_s: NotNegative
    friction_duty: NotNegative


class VelocityLimits(Section):
    """Limits of the set-point the motor loop accepts."""

    v_m_per_s: Positive
    omega_rad_per_s: Positive
    a_m_per_s2: Positive
    d_omega_rad_per_s2: Positive


class Health(Section):
    """When the motor loop finds the robot unfit to drive."""

    battery_low_v: NotNegative
    battery_s: NotNegative
    encoder_timeout_s: Positive
    stuck_duty: Share
    stuck_s: Positive


class MotorLoop(Section):
    """The onboard program."""

    rate_hz: Positive
    wheel_state_rate_hz: Positive
    wheel_state_window_s: Positive
    status_rate_hz: Positive
    watchdog_s: Positive
    command_lifetime_s: Positive
    encoder_counts_per_rev: Annotated[int, Field(ge=4)]
    health: Health
    pid: Pid
    limits: VelocityLimits


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


class Placement(Section):
    """How exactly a hand places the robot: uniform within plus and minus these."""

    position_m: NotNegative
    angle_rad: NotNegative


class Plant(Section):
    """What stands in for hardware."""

    encoder_rate_hz: Positive
    largest_step_s: Positive
    initial_pose: Triple
    motor: Motor
    battery: Battery
    body: Body
    placement: Placement


class Mocap(Section):
    """The motion-capture cameras."""

    rate_hz: Positive
    latency_s: NotNegative
    latency_jitter_s: NotNegative
    position_noise_m: NotNegative
    angle_noise_rad: NotNegative
    marker_offset: Triple
    lost_frame_share: Share
    occlusions_per_s: NotNegative
    occlusion_s: Annotated[tuple[NotNegative, NotNegative], AfterValidator(_ordered)]


class StateSet(Section):
    """A box of poses and velocities, each as [low, high]."""

    x1_m: Range
    x2_m: Range
    theta_rad: Range
    v_m_per_s: Range
    omega_rad_per_s: Range


class Sampler(Section):
    """The calibration session."""

    segments_per_basis: Annotated[int, Field(ge=1)]
    basis_inputs: Annotated[tuple[Pair, ...], Field(min_length=2, max_length=3)]
    draw_set: StateSet
    admissible_set: StateSet
    smallest_steps: Annotated[int, Field(ge=1)]
    largest_steps: Annotated[int, Field(ge=1)]
    drive_speed_m_per_s: Positive
    turn_speed_rad_per_s: Positive
    acceleration_m_per_s2: Positive
    turn_acceleration_rad_per_s2: Positive
    position_tolerance_m: Positive
    angle_tolerance_rad: Positive
    settle_s: NotNegative
    phase_time_limit_s: Positive
    tracking_timeout_s: Positive

    @property
    def indexed_inputs(self) -> dict[int, Pair]:
        """The basis inputs by their index in the paper.

        Two inputs are u_1 and u_2 of a driftless robot, whose M_0 is the identity; three begin
        with u_0.
        """
        return dict(enumerate(self.basis_inputs, start=3 - len(self.basis_inputs)))


class InfinityShape(Section):
    """A lying eight at constant speed, from a stand on the straight line to its crossing."""

    start_pose: Triple
    speed_m_per_s: Positive
    lap_s: Positive


class SquareShape(Section):
    """Four straight sides, a turn on the spot to the left after each."""

    start_pose: Triple
    speed_m_per_s: Positive
    side_m: Positive
    turn_speed_rad_per_s: Positive


class Reference(Section):
    """Runs that models are validated with."""

    runs: Annotated[int, Field(ge=1)]
    acceleration_m_per_s2: Positive
    turn_acceleration_rad_per_s2: Positive
    settle_s: NotNegative
    infinity: InfinityShape
    square: SquareShape


class Processing(Section):
    """From a session log to a data set."""

    dt_s: Positive
    smoothing_window: Annotated[int, Field(ge=1)]
    discard_start_s: NotNegative
    discard_end_s: NotNegative
    remove_marker_offset: bool


def _joined(given: Any) -> Any:
    if not isinstance(given, (list, tuple)):
        return given
    wrong = [i for i in given if isinstance(i, bool) or not isinstance(i, (str, int, float))]
    if wrong:
        raise ValueError(f"{wrong[0]!r} is no expression")
    return ", ".join(map(str, given))


class Model(Section):
    """What is learned.

    A dictionary is a name, or expressions: as a list, or with commas between them.
    """

    dictionary: Annotated[str, BeforeValidator(_joined)]


CostName = Literal["me", "ce", "ds"]
"""Stage costs of the paper's section 3.3."""


BackEnd = Literal["ddp", "fatrop", "ipopt"]
"""Solvers of the optimal control problem."""


class Weights(Section):
    """Diagonal weights of one stage cost: q for states (``ds``: observables), r for inputs.

    A single weight in the q of ``ds`` is that of every observable.
    """

    q: Annotated[tuple[NotNegative, ...], Field(min_length=1)]
    r: tuple[Positive, Positive]


class OffsetFree(Section):
    """What takes the steady error of a model out of the plans."""

    enabled: bool
    time_constant_s: Positive
    largest_m_per_s: Positive
    largest_rad_per_s: Positive


class Area(Section):
    """A rectangle of the floor."""

    x1_m: Pair
    x2_m: Pair


class Controller(Section):
    """The predictive controller."""

    dt_s: Positive
    horizon: Annotated[int, Field(ge=1, le=1000)]
    cost: CostName
    predict: Literal["koopman", "nominal"]
    reprojection: bool
    solver: BackEnd
    use_compiler: bool
    offset_free: OffsetFree
    u_max: tuple[Positive, Positive]
    speed_max: tuple[Positive, Positive] | None
    weights: dict[CostName, Weights]
    goal_area: Area
    parked_position_m: Pair
    parked_angle_rad: Positive
    parked_hold_s: NotNegative
    time_limit_s: Positive
    tracking_timeout_s: Positive
    pause_limit_s: NotNegative
    largest_failures_in_a_row: Annotated[int, Field(ge=1)]


class Logger(Section):
    """The logger."""

    largest_file_bytes: Annotated[int, Field(ge=1_000_000)]


class LabConfig(Section):
    """One lab."""

    seed: Annotated[int, Field(ge=0)]
    robot: Robot
    bus: Bus
    radio: Radio
    clock: Clock
    faults: tuple[PlannedFault, ...]
    motor_loop: MotorLoop
    plant: Plant
    mocap: Mocap
    logger: Logger
    sampler: Sampler
    reference: Reference
    processing: Processing
    model: Model
    controller: Controller

    @model_validator(mode="after")
    def _fits_the_robot(self) -> LabConfig:
        kind, states = self.robot.kind, {"kinematic": 3, "dynamic": 5}[self.robot.kind]
        for cost, weights in self.controller.weights.items():
            if cost != "ds" and len(weights.q) != states:
                raise ValueError(
                    f"controller.weights.{cost}.q has {len(weights.q)} weights, "
                    f"the {kind} robot has {states} states"
                )
        if self.controller.cost not in self.controller.weights:
            raise ValueError(f"controller.weights lacks the cost {self.controller.cost!r}")
        if kind == "kinematic" and self.controller.speed_max is not None:
            raise ValueError(
                "controller.speed_max is for the dynamic robot; the inputs of the kinematic one "
                "are its speeds, bounded by controller.u_max"
            )
        if kind == "dynamic" and len(self.sampler.basis_inputs) != 3:
            raise ValueError("sampler.basis_inputs of the dynamic robot must be u_0, u_1, u_2")
        return self

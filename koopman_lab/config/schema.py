"""The configuration of a lab: frozen models that refuse unknown keys.

What each value means, its unit and where it comes from is said in ``defaults/*.yaml``; this file
says which values are allowed, `motor_loop` and `simulation` those of their sections.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BeforeValidator, Field, model_validator

from koopman_lab.config.cost_table import COSTS, known_cost
from koopman_lab.config.motor_loop import MotorLoop
from koopman_lab.config.robot_fit import require_fit
from koopman_lab.config.simulation import Simulation
from koopman_lab.config.values import (
    Input,
    InputBounds,
    NotNegative,
    Pair,
    Positive,
    Range,
    Section,
    Triple,
)
from koopman_lab.errors import ConfigError
from koopman_lab.robots.table import robot_type


class Robot(Section):
    """The robot as the software believes it to be."""

    name: Annotated[str, Field(pattern=r"^[A-Z][A-Z0-9]{0,15}$")]
    kind: str
    wheel_radius_m: Positive
    track_width_m: Positive


class Bus(Section):
    """The LCM bus."""

    url: str
    receive_buffer_bytes: Annotated[int, Field(ge=65536)]
    heartbeat_rate_hz: Positive
    key_file: Annotated[str, Field(min_length=1)] | None


class ClockSync(Section):
    """How the board finds out what time it is at the desk."""

    ping_rate_hz: Positive
    window_s: Positive
    largest_drift_ppm: NotNegative


class Placement(Section):
    """How exactly a hand places the robot: uniform within plus and minus these."""

    position_m: NotNegative
    angle_rad: NotNegative


class Mocap(Section):
    """The motion-capture cameras."""

    rate_hz: Positive


class Area(Section):
    """A rectangle in the inertial frame, each side as [low, high]."""

    x1_m: Range
    x2_m: Range


class StateSet(Area):
    """A box of poses and velocities, each as [low, high]."""

    theta_rad: Range
    v_m_per_s: Range
    omega_rad_per_s: Range


class Sampler(Section):
    """The calibration session."""

    segments_per_basis: Annotated[int, Field(ge=1)]
    basis_inputs: Annotated[tuple[Input, ...], Field(min_length=1)]
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
    wait_limit_s: Positive
    largest_redraws_in_a_row: Annotated[int, Field(ge=1)]

    @property
    def indexed_inputs(self) -> dict[int, Input]:
        """The basis inputs by their index in the paper.

        As many as an input has numbers are u_1, u_2, ... of a driftless robot, whose M_0 is the
        identity; one more, and they begin with u_0.
        """
        m = len(self.basis_inputs[0])
        return dict(enumerate(self.basis_inputs, start=1 + m - len(self.basis_inputs)))


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


def _comma_separated(value: Any) -> Any:
    if not isinstance(value, (list, tuple)):
        return value
    wrong = [i for i in value if isinstance(i, bool) or not isinstance(i, (str, int, float))]
    if wrong:
        raise ValueError(f"{wrong[0]!r} is no expression")
    return ", ".join(map(str, value))


class Model(Section):
    """What is learned.

    A dictionary is a name, or expressions: as a list, or with commas between them.
    """

    dictionary: Annotated[str, BeforeValidator(_comma_separated)]


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
    time_constant_s: Positive
    largest_m_per_s: Positive
    largest_rad_per_s: Positive


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
    u_max: InputBounds
    speed_max: InputBounds | None
    weights: dict[CostName, Weights]
    parked_position_m: Pair
    parked_angle_rad: Positive
    parked_hold_s: NotNegative
    time_limit_s: Positive
    tracking_timeout_s: Positive
    pause_limit_s: NotNegative
    largest_failures_in_a_row: Annotated[int, Field(ge=1)]


class Logger(Section):
    """The node that writes the session log."""

    largest_file_bytes: Annotated[int, Field(ge=1_000_000)]


class LabConfig(Section):
    """One lab; with a real robot nothing is simulated, and ``simulation`` is None."""

    seed: Annotated[int, Field(ge=0)]
    robot: Robot
    bus: Bus
    clock: ClockSync
    motor_loop: MotorLoop
    mocap: Mocap
    placement: Placement
    floor: Area
    simulation: Simulation | None
    logger: Logger
    sampler: Sampler
    reference: Reference
    processing: Processing
    model: Model
    controller: Controller

    def require_simulation(self) -> Simulation:
        """Return what is simulated, for whoever stands in for hardware.

        Raises
        ------
        ConfigError
            If nothing is.
        """
        if self.simulation is None:
            raise ConfigError(
                "simulation: null, so that no plant can stand in for the robot; start `klab run "
                "onboard` and the robot's own driver first, or take --preset lab"
            )
        return self.simulation

    @model_validator(mode="after")
    def _drifts_as_the_board_expects(self) -> LabConfig:
        largest_ppm, simulation = self.clock.largest_drift_ppm, self.simulation
        if simulation is not None and abs(simulation.clock.drift_ppm) > largest_ppm:
            raise ValueError(
                f"simulation.clock.drift_ppm {simulation.clock.drift_ppm:g} is beyond "
                f"clock.largest_drift_ppm {largest_ppm:g}, so that no error bound would hold"
            )
        return self

    @model_validator(mode="after")
    def _fits_the_robot(self) -> LabConfig:
        require_fit(self, robot_type(self.robot.kind))
        # Whether a cost of another package has weights of its own, it is asked where it is built.
        cost = COSTS.builtin_row(self.controller.cost)
        if cost is not None and not cost.weights and cost.name not in self.controller.weights:
            raise ValueError(f"controller.weights lacks the cost {cost.name!r}")
        return self

"""The configuration of a lab: frozen models that refuse unknown keys.

What each value means, its unit and where it comes from is said in ``defaults/*.yaml``; this file
says which values are allowed; `motor_loop`, `sampler`, `controller` and `simulation` those of their
sections.
"""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import BeforeValidator, Field, model_validator

from koopman_lab.config.bounds import Bounds
from koopman_lab.config.controller import Controller
from koopman_lab.config.cost_table import COSTS
from koopman_lab.config.motor_loop import MotorLoop
from koopman_lab.config.robot_fit import RobotMisfitError, require_fit
from koopman_lab.config.sampler import Area, Sampler
from koopman_lab.config.simulation import Simulation
from koopman_lab.config.values import (
    Acceleration,
    Counting,
    Duration,
    Metres,
    NoiseM,
    NoiseRad,
    NotNegative,
    PoseValues,
    Rate,
    Seconds,
    Section,
    Speed,
    TurnAcceleration,
    TurnSpeed,
)
from koopman_lab.errors import ConfigError
from koopman_lab.robots.table import robot_type

MOST_M_PER_S2, MOST_RAD_PER_S2 = 50.0, 500.0
"""Five times what rubber holds; without mass and lag (`ideal`) there is no end."""


class Robot(Section):
    """The robot as the software believes it to be."""

    name: Annotated[str, Field(pattern=r"^[A-Z][A-Z0-9]{0,15}$")]
    kind: str
    wheel_radius_m: Annotated[Metres, Bounds(0.002, 0.5, "m")]
    track_width_m: Annotated[Metres, Bounds(0.01, 5.0, "m")]


class Bus(Section):
    """The LCM bus."""

    url: str
    receive_buffer_bytes: Annotated[
        int,
        Field(ge=65536),
        Bounds(
            *(65_536, 268_435_456, "bytes"),
            too_much="what waits there for so long is no news, and the memory is the kernel's",
        ),
    ]
    heartbeat_rate_hz: Annotated[
        Rate,
        Bounds(
            *(1.0, 50.0, "Hz", "after 2 s without a heartbeat a process counts as silent"),
            "the bus would carry little else",
        ),
    ]
    key_file: Annotated[str, Field(min_length=1)] | None


class ClockSync(Section):
    """How the board finds out what time it is at the desk."""

    ping_rate_hz: Annotated[
        Rate,
        Bounds(
            *(0.1, 100.0, "Hz", "the board would not know the desk's time for long"),
            "the radio would carry little else",
        ),
    ]
    window_s: Annotated[
        Duration,
        Bounds(
            *(1.0, 3600.0, "s", "there is nothing to choose the best answer from"),
            "no crystal keeps its drift for so long",
        ),
    ]
    largest_drift_ppm: Annotated[
        NotNegative, Bounds(0.0, 1000.0, "ppm", too_much="such a clock is broken")
    ]


class Placement(Section):
    """How exactly a hand places the robot: uniform within plus and minus these."""

    position_m: NoiseM
    angle_rad: NoiseRad


class Mocap(Section):
    """The motion-capture cameras."""

    rate_hz: Annotated[
        Rate,
        Bounds(
            *(10.0, 10_000.0, "Hz", "tracking would be lost from frame to frame"),
            "no motion-capture cameras are so fast",
        ),
    ]


class InfinityShape(Section):
    """A lying eight at constant speed, from a stand on the straight line to its crossing."""

    start_pose: PoseValues
    speed_m_per_s: Speed
    lap_s: Duration


class SquareShape(Section):
    """Four straight sides, a turn on the spot to the left after each."""

    start_pose: PoseValues
    speed_m_per_s: Speed
    side_m: Metres
    turn_speed_rad_per_s: TurnSpeed


class Reference(Section):
    """Runs that models are validated with."""

    runs: Counting
    acceleration_m_per_s2: Acceleration
    turn_acceleration_rad_per_s2: TurnAcceleration
    settle_s: Seconds
    infinity: InfinityShape
    square: SquareShape


class Processing(Section):
    """From a session log to a data set."""

    dt_s: Annotated[Duration, Bounds(0.001, 10.0, "s")]
    smoothing_window: Annotated[Counting, Bounds(1, 100_000)]
    discard_start_s: Seconds
    discard_end_s: Seconds
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


class Commander(Section):
    """Whoever drives the robot from the desk: controller, sampler, reference."""

    standstill_limit_s: Annotated[
        Duration,
        Bounds(
            *(0.1, 10.0, "s", "a busy machine holds every program up for so long"),
            "who stood still for so long knows nothing of the robot any more",
        ),
    ]
    refused_limit_s: Annotated[
        Duration,
        Bounds(
            *(0.1, 10.0, "s", "a command that a radio delays looks refused for so long"),
            "somebody else would drive the robot meanwhile",
        ),
    ]


class Logger(Section):
    """The node that writes the session log."""

    largest_file_bytes: Annotated[
        int,
        Field(ge=1_000_000),
        Bounds(1_000_000, 1_000_000_000_000, "bytes", too_much="no disk holds such a file"),
    ]


class LabConfig(Section):
    """One lab; with a real robot nothing is simulated, and ``simulation`` is None."""

    seed: Annotated[int, Field(ge=0), Bounds(0, 2**63 - 1)]
    robot: Robot
    bus: Bus
    clock: ClockSync
    motor_loop: MotorLoop
    mocap: Mocap
    placement: Placement
    floor: Area
    simulation: Simulation | None
    logger: Logger
    commander: Commander
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
    def _brakes_as_motors_can(self) -> LabConfig:
        """Refuse limits that promise a braking distance of nothing to the guard of the floor."""
        limits, simulation = self.motor_loop.limits, self.simulation
        if simulation is not None and simulation.plant.motor.drive != "dc":
            return self
        for name, most in (("a_m_per_s2", MOST_M_PER_S2), ("d_omega_rad_per_s2", MOST_RAD_PER_S2)):
            value = getattr(limits, name)
            if value > most:
                raise RobotMisfitError(
                    f"motor_loop.limits.{name}",
                    f"{value:g} is more than {most:g}: no wheel holds the floor so hard, and the "
                    "robot would be believed to stop where it cannot",
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

"""What a kind of robot is: one frozen description that everything else asks."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

import lcmtypes
from koopman_lab.errors import ConfigError, UsageError
from koopman_lab.robots.body_drive import BodyDrive
from koopman_lab.robots.command_message import CommandMessage
from koopman_lab.robots.standard_runs import StandardRuns

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    Array = NDArray[np.float64]
else:
    # Whoever only names a robot, as each command does, has no need to wait for NumPy.
    Array = Any
POSE_NAMES = ("x1", "x2", "theta")
POSE_DIM = len(POSE_NAMES)
MOST_STATES, MOST_INPUTS = lcmtypes.mpc_state_t.MOST_STATES, lcmtypes.mpc_state_t.MOST_INPUTS
"""Lengths of the arrays that hold states and inputs in messages."""
Components = list[Any]
"""Numbers, arrays of equal shape, or CasADi symbols."""


class Quantity(NamedTuple):
    """A state or an input.

    Attributes
    ----------
    name
        As in expressions and figures, such as ``theta``.
    unit
        For a person, such as ``rad/s``; empty for a number without one.
    """

    name: str
    unit: str

    @property
    def column(self) -> str:
        """Return the name of a column of a table, such as ``omega_rad_per_s``."""
        unit = self.unit.replace("/", "_per_").replace("²", "2")
        return f"{self.name}_{unit}" if unit else self.name

    @property
    def label(self) -> str:
        """Return what to write at an axis, such as ``dω (rad/s²)``."""
        name = self.name.replace("d_omega", "dω").replace("omega", "ω").replace("theta", "θ")
        return f"{name} ({self.unit})" if self.unit else name


class TextFile(Protocol):
    """A file of a package, as :mod:`importlib.resources` has it, or a path."""

    @property
    def name(self) -> str:
        """Return its name without folders."""

    def read_text(self, encoding: str | None = None) -> str:
        """Return what it holds."""


@dataclass(frozen=True)
class RobotType:
    """A kind of robot.

    Its states begin with the pose ``x1, x2, theta`` (m, m, rad) in the inertial frame, and all of
    its motions keep their shape when the frame is moved and turned (paper, section 2.1).

    Attributes
    ----------
    name
        As in ``robot.kind`` and ``--robot``.
    title
        In words, such as ``second-order robot``.
    states, inputs
        In their order.
    components
        The nominal equations over one sampling interval of constant input: maps the components of
        state and input, the interval (s) and the module of functions to use, NumPy for arrays or
        CasADi for symbols, to the components of the successor.
    drifts
        Whether it moves on under the input zero, so that M_0 must be learned from data of u_0.
    sideways
        States that are reached only by combining motions (sideways, for wheels), by index: those
        that the mixed-exponents cost squares (paper, section 3.3).
    speeds_at
        Where the state holds the body velocity (v, omega); empty where it does not. Data sets take
        these states from differences of the poses; what else is behind the pose no camera sees.
    braking
        Maps a state (n,), the largest inputs (m,), the sampling time (s) and a number of steps to
        inputs (steps, m) that bring the robot to rest as fast as the bounds allow.
    effort
        Maps a horizon to the course (H,) of a first guess in [-1, 1], a share of full effort.
    turn
        Maps a yaw rate (rad/s), and a forward speed (m/s) for robots whose state holds one, to what
        stands behind the pose (n - 3,) and the input (m,) in a turn on the spot; None for robots
        that may well move sideways in it, for whom that is no defect of a model.
    command
        The message that carries its inputs; None for one that is only simulated.
    drive
        How the inputs move the body velocity, for a robot on two driven wheels; None for any
        other, which our motor loop, sampler and reference driver cannot move.
    defaults
        The YAML file with what a lab of it does not say itself. Its section ``presets`` holds
        what a preset changes for this kind alone. None where a lab says everything.
    runs
        What commands do with it that are not told otherwise.
    """

    name: str
    title: str
    states: tuple[Quantity, ...]
    inputs: tuple[Quantity, ...]
    components: Callable[[Components, Components, Any, Any], Components]
    drifts: bool
    sideways: tuple[int, ...]
    speeds_at: tuple[int, ...]
    braking: Callable[[Array, Array, float, int], Array]
    effort: Callable[[int], Array]
    turn: Callable[[float, float], tuple[Array, Array]] | None = None
    command: CommandMessage | None = None
    drive: BodyDrive | None = None
    defaults: TextFile | None = None
    runs: StandardRuns = field(default_factory=StandardRuns)

    def __post_init__(self) -> None:
        for fault in self._faults():
            raise ConfigError(f"robot {self.name!r}{fault}")

    def _faults(self) -> Iterator[str]:
        """Give what is wrong with the description."""
        for what, quantities, largest in (
            ("states", self.states, MOST_STATES),
            ("inputs", self.inputs, MOST_INPUTS),
        ):
            if not 1 <= len(quantities) <= largest:
                yield (
                    f" has {len(quantities)} {what}, messages have room for {largest}; describe it "
                    f"with 1 to {largest}"
                )
        if self.state_names[:POSE_DIM] != POSE_NAMES:
            yield (
                f": the states begin with {', '.join(self.state_names[:3])}, expected the pose "
                f"{', '.join(POSE_NAMES)}; put it first"
            )
        if self.command is not None and len(self.command.fields) != self.input_dim:
            yield (
                f" has {self.input_dim} inputs, its command message carries "
                f"{len(self.command.fields)}; name a field for each"
            )
        if self.drive is not None and self.input_dim != len(self.drive.limits):
            yield (
                f" has {self.input_dim} inputs, a robot on two driven wheels has "
                f"{len(self.drive.limits)}; leave out its drive"
            )

    @property
    def state_names(self) -> tuple[str, ...]:
        """Return the names of the states."""
        return tuple(state.name for state in self.states)

    @property
    def input_names(self) -> tuple[str, ...]:
        """Return the names of the inputs."""
        return tuple(u.name for u in self.inputs)

    @property
    def state_dim(self) -> int:
        """Return the number n of states."""
        return len(self.states)

    @property
    def input_dim(self) -> int:
        """Return the number m of inputs."""
        return len(self.inputs)

    def step(self, x: Array, u: Array, dt_s: float) -> Array:
        """Return the successors (..., n) of states ``x`` (..., n) under inputs ``u`` (..., m)."""
        import numpy as np

        x, u = np.asarray(x, float), np.asarray(u, float)
        states = [x[..., i] for i in range(self.state_dim)]
        inputs = [u[..., i] for i in range(self.input_dim)]
        return np.stack(self.components(states, inputs, dt_s, np), axis=-1)

    def state(self, pose: Sequence[float], velocity: Sequence[float] | None = None) -> Array:
        """Return the state (n,) in a pose (m, m, rad), at rest or with a body velocity.

        A state that holds no velocity takes none.
        """
        import numpy as np

        x = np.zeros(self.state_dim)
        x[: len(pose)] = pose
        if velocity is not None and self.speeds_at:
            x[list(self.speeds_at)] = velocity
        return x

    @property
    def basis_counts(self) -> tuple[int, ...]:
        """Return how many basis inputs can train it: m beside u_0, which no drift makes needless.

        See the paper's section 2.2.
        """
        m = self.input_dim
        return (m + 1,) if self.drifts else (m, m + 1)

    def commanded(self) -> CommandMessage:
        """Return the message that carries its inputs.

        Raises
        ------
        UsageError
            If there is none.
        """
        if self.command is None:
            raise UsageError(
                f"the {self.name} robot has no command message, so that nobody can drive it; give "
                "its description one, or simulate it with `klab simulate`"
            )
        return self.command

    def on_two_wheels(self, who: str = "the motor loop") -> BodyDrive:
        """Return how its inputs move its body velocity.

        Parameters
        ----------
        who
            Asks for it, in words for a person.

        Raises
        ------
        UsageError
            If it does not roll on two driven wheels.
        """
        if self.drive is None:
            raise UsageError(
                f"{who} moves robots on two driven wheels, the {self.name} robot is none: its "
                "description has no drive; run a program of its own that takes its commands"
            )
        return self.drive

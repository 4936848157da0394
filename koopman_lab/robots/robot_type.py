"""What a kind of robot is: one frozen description that everything else asks."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from koopman_lab.errors import ConfigError

Array = NDArray[np.float64]
POSE_NAMES = ("x1", "x2", "theta")
POSE_DIM = len(POSE_NAMES)
MOST_STATES, MOST_INPUTS = 16, 8
"""As many as the arrays of the messages hold: MPC_STATE, SAMPLER_STATE and REFERENCE_STATE."""
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

    def __post_init__(self) -> None:
        for what, quantities, most in (
            ("states", self.states, MOST_STATES),
            ("inputs", self.inputs, MOST_INPUTS),
        ):
            if not 1 <= len(quantities) <= most:
                raise ConfigError(
                    f"robot {self.name!r} has {len(quantities)} {what}, messages have room for "
                    f"{most}; describe it with 1 to {most}"
                )
        if self.state_names[:POSE_DIM] != POSE_NAMES:
            raise ConfigError(
                f"robot {self.name!r}: the states begin with {', '.join(self.state_names[:3])}, "
                f"expected the pose {', '.join(POSE_NAMES)}; put it first"
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
        x, u = np.asarray(x, float), np.asarray(u, float)
        states = [x[..., i] for i in range(self.state_dim)]
        inputs = [u[..., i] for i in range(self.input_dim)]
        return np.stack(self.components(states, inputs, dt_s, np), axis=-1)

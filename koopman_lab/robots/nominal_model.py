"""Nominal models of the robot, exact over one control interval, in NumPy and CasADi alike."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from koopman_lab.config.values import RobotKind

Components = list[Any]
"""Numbers, arrays of equal shape, or CasADi symbols."""


@dataclass(frozen=True)
class NominalModel:
    """A zero-order-hold step of the nominal equations.

    ``components`` maps the components of the state and of the input, and the interval, to the
    components of the successor. It is written once and takes the module of functions to use:
    NumPy for arrays, CasADi for symbols.
    """

    kind: RobotKind
    state_names: tuple[str, ...]
    input_names: tuple[str, str]
    components: Callable[[Components, Components, float, Any], Components]

    @property
    def state_dim(self) -> int:
        """Return 3 (x1, x2, theta) or 5 (with v, omega)."""
        return len(self.state_names)

    def step(
        self, x: NDArray[np.float64], u: NDArray[np.float64], dt_s: float
    ) -> NDArray[np.float64]:
        """Return the successors of states ``x`` (..., n) under inputs ``u`` (..., 2)."""
        x, u = np.asarray(x, float), np.asarray(u, float)
        states = [x[..., i] for i in range(self.state_dim)]
        return np.stack(self.components(states, [u[..., 0], u[..., 1]], dt_s, np), axis=-1)


# Gauss-Legendre nodes and weights on [0, 1]. Six points integrate cos and sin of the angle over
# a control interval to rounding for every turn that the robot can make in it.
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(6)
_QUADRATURE = [
    (float(0.5 * (1 + n)), float(0.5 * w)) for n, w in zip(_NODES, _WEIGHTS, strict=True)
]


def _roll(
    pose: Components, speed: Components, change: Components, dt_s: float, m: Any
) -> Components:
    """Integrate the kinematics for linearly changing v and omega (the integrals are Fresnel's)."""
    x1, x2, theta = pose
    v, omega = speed
    a, d_omega = change
    for node, weight in _QUADRATURE:
        time = node * dt_s
        angle = theta + omega * time + d_omega * (0.5 * time * time)
        distance = (v + a * time) * (weight * dt_s)
        x1 = x1 + distance * m.cos(angle)
        x2 = x2 + distance * m.sin(angle)
    return [x1, x2, theta + omega * dt_s + d_omega * (0.5 * dt_s * dt_s)]


def _kinematic(x: Components, u: Components, dt_s: float, m: Any) -> Components:
    return _roll(x, u, [0.0, 0.0], dt_s, m)


def _dynamic(z: Components, u: Components, dt_s: float, m: Any) -> Components:
    pose = _roll(z[:3], z[3:], u, dt_s, m)
    return [*pose, z[3] + u[0] * dt_s, z[4] + u[1] * dt_s]


KINEMATIC = NominalModel("kinematic", ("x1", "x2", "theta"), ("v", "omega"), _kinematic)
"""The paper's kinematic model, section 3.1: state (m, m, rad), input (m/s, rad/s)."""

DYNAMIC = NominalModel("dynamic", ("x1", "x2", "theta", "v", "omega"), ("a", "d_omega"), _dynamic)
"""The paper's second-order model, section 3.2: state (m, m, rad, m/s, rad/s), input (m/s^2,
rad/s^2)."""


def nominal_model(kind: RobotKind) -> NominalModel:
    """Return the nominal model of a robot."""
    return DYNAMIC if kind == "dynamic" else KINEMATIC

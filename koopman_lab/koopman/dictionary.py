"""Dictionaries of observables and the reprojection that belongs to each (paper, section 3.4)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from koopman_lab.config.schema import RobotKind
from koopman_lab.errors import ModelError
from koopman_lab.robot.models import nominal_model

Array = NDArray[np.float64]
Components = list[Any]
"""Numbers, arrays of equal shape, or CasADi symbols."""


@dataclass(frozen=True)
class Dictionary:
    """A vector psi of M observables of the state.

    ``observables`` is written once and serves arrays and symbols alike: it takes the components
    of the state and the module of functions to use, NumPy or CasADi. The first observable is the
    constant. ``state_rows`` says where psi holds each state; an angle that psi does not hold
    has row None and follows from ``cosine_row`` and ``sine_row``.
    """

    name: str
    kind: RobotKind
    names: tuple[str, ...]
    observables: Callable[[Components, Any], Components]
    state_rows: tuple[int | None, ...]
    cosine_row: int | None = None
    sine_row: int | None = None

    @property
    def size(self) -> int:
        """Return the number M of observables."""
        return len(self.names)

    @property
    def state_dim(self) -> int:
        """Return the number n of states."""
        return len(self.state_rows)

    def lift(self, x: Array) -> Array:
        """Return psi (..., M) of states (..., n)."""
        x = np.asarray(x, float)
        values = self.observables([x[..., i] for i in range(self.state_dim)], np)
        return np.stack([np.broadcast_to(value, x.shape[:-1]) for value in values], axis=-1)

    def project(self, psi: Array, previous_theta: Array | float | None = None) -> Array:
        """Return the states (..., n) that observables (..., M) stand for: the reprojection pi.

        Parameters
        ----------
        psi
            Observables, not necessarily on the manifold.
        previous_theta
            Where the angle comes from the four-quadrant arctangent it lies in (-pi, pi]; with
            this angle (rad) given it is continued from there instead, without jumps of 2 pi.
        """
        psi = np.asarray(psi, float)
        rows = [psi[..., i] for i in range(self.size)]
        return np.stack(self.project_components(rows, previous_theta, np), axis=-1)

    def project_components(self, psi: Components, previous_theta: Any, m: Any) -> Components:
        """Return the reprojection by components, with the functions of NumPy or CasADi."""
        return [
            self._angle(psi, previous_theta, m) if row is None else psi[row]
            for row in self.state_rows
        ]

    def _angle(self, psi: Components, previous_theta: Any, m: Any) -> Any:
        assert self.cosine_row is not None  # by the definitions below
        assert self.sine_row is not None
        cosine, sine = psi[self.cosine_row], psi[self.sine_row]
        if previous_theta is None:
            return m.arctan2(sine, cosine)
        c, s = m.cos(previous_theta), m.sin(previous_theta)
        return previous_theta + m.arctan2(sine * c - cosine * s, cosine * c + sine * s)


def _d5t(x: Components, m: Any) -> Components:
    x1, x2, theta = x
    return [1.0, x1, x2, m.cos(theta), m.sin(theta)]


def _d8_euler(z: Components, m: Any) -> Components:
    x1, x2, theta, v, omega = z
    return [1.0, x1, x2, theta, v, omega, v * m.cos(theta), v * m.sin(theta)]


def _d10_monomial(z: Components, _: Any) -> Components:
    x1, x2, theta, v, omega = z
    powers = [v * theta**2, v * theta**3, v * theta**4]
    return [1.0, x1, x2, theta, v, omega, v * omega, *powers]


def _d13_trigonometric(z: Components, m: Any) -> Components:
    x1, x2, theta, v, omega = z
    s, c = m.sin(theta), m.cos(theta)
    return [1.0, x1, x2, s, c, v, omega, v * c, v * s, omega * s, omega * c, s * c, c * c]


def _d12_fourier(z: Components, m: Any) -> Components:
    x1, x2, theta, v, omega = z
    waves = [v * wave(k * theta) for k in (1, 2, 3) for wave in (m.cos, m.sin)]
    return [1.0, x1, x2, theta, v, omega, *waves]


_STATE = ("1", "x1", "x2", "theta", "v", "omega")

D5T = Dictionary(
    "D5t", "kinematic", ("1", "x1", "x2", "cos(theta)", "sin(theta)"), _d5t, (1, 2, None), 3, 4
)
D8_EULER = Dictionary(
    "D8Eul", "dynamic", (*_STATE, "v*cos(theta)", "v*sin(theta)"), _d8_euler, (1, 2, 3, 4, 5)
)
D10_MONOMIAL = Dictionary(
    "D10m",
    "dynamic",
    (*_STATE, "v*omega", "v*theta^2", "v*theta^3", "v*theta^4"),
    _d10_monomial,
    (1, 2, 3, 4, 5),
)
D13_TRIGONOMETRIC = Dictionary(
    "D13t",
    "dynamic",
    (
        "1",
        "x1",
        "x2",
        "sin(theta)",
        "cos(theta)",
        "v",
        "omega",
        "v*cos(theta)",
        "v*sin(theta)",
        "omega*sin(theta)",
        "omega*cos(theta)",
        "sin(theta)*cos(theta)",
        "cos(theta)^2",
    ),
    _d13_trigonometric,
    (1, 2, None, 5, 6),
    cosine_row=4,
    sine_row=3,
)
D12_FOURIER = Dictionary(
    "D12f",
    "dynamic",
    _STATE + tuple(f"v*{wave}({k}*theta)" for k in (1, 2, 3) for wave in ("cos", "sin")),
    _d12_fourier,
    (1, 2, 3, 4, 5),
)

DICTIONARIES = {d.name: d for d in (D5T, D8_EULER, D10_MONOMIAL, D13_TRIGONOMETRIC, D12_FOURIER)}


def dictionary(name: str, kind: RobotKind) -> Dictionary:
    """Return a dictionary by its name.

    Raises
    ------
    ModelError
        If there is none of this name for the robot; the message lists those there are.
    """
    fitting = [d for d in DICTIONARIES.values() if d.kind == kind]
    for candidate in fitting:
        if candidate.name == name:
            return candidate
    reason = f"is for the {DICTIONARIES[name].kind} robot" if name in DICTIONARIES else "unknown"
    raise ModelError(
        f"dictionary {name!r}: {reason}; for the {kind} robot (states "
        f"{', '.join(nominal_model(kind).state_names)}) there are: "
        f"{', '.join(d.name for d in fitting)}"
    )

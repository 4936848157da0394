"""Dictionaries of observables and the reprojection that belongs to each (paper, section 3.4)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from koopman_lab.errors import ModelError
from koopman_lab.koopman.expression import Components, Expressions, canonical, split
from koopman_lab.robots.dynamic import DYNAMIC
from koopman_lab.robots.kinematic import KINEMATIC
from koopman_lab.robots.robot_type import RobotType
from koopman_lab.robots.table import robot_type

Array = NDArray[np.float64]
CUSTOM = "own"
"""Ends the names of dictionaries that are given as expressions: D8own."""


@dataclass(frozen=True)
class Dictionary:
    """A vector psi of M observables of the state.

    ``observables`` is written once and serves arrays and symbols alike: it takes the components
    of the state and the module of functions to use, NumPy or CasADi. The first observable is the
    constant. ``state_rows`` says where psi holds each state; an angle that psi does not hold
    has row None and follows from ``cosine_row`` and ``sine_row``.

    :func:`from_expressions` makes one of expressions; a function of one's own goes in here
    directly, and :func:`register` makes it known by name.
    """

    name: str
    kind: str
    names: tuple[str, ...]
    observables: Callable[[Components, Any], Components]
    state_rows: tuple[int | None, ...]
    cosine_row: int | None = None
    sine_row: int | None = None

    @property
    def robot(self) -> RobotType:
        """Return the robot whose states these are."""
        return robot_type(self.kind)

    @property
    def expressions(self) -> tuple[str, ...] | None:
        """Return the observables as expressions, None where they are a function of one's own."""
        observables = self.observables
        return observables.texts if isinstance(observables, Expressions) else None

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
        assert self.cosine_row is not None  # no dictionary is without: from_expressions, register
        assert self.sine_row is not None
        cosine, sine = psi[self.cosine_row], psi[self.sine_row]
        if previous_theta is None:
            return m.arctan2(sine, cosine)
        c, s = m.cos(previous_theta), m.sin(previous_theta)
        return previous_theta + m.arctan2(sine * c - cosine * s, cosine * c + sine * s)


def from_expressions(name: str, kind: str, expressions: Sequence[str]) -> Dictionary:
    """Return a dictionary of expressions such as ``v*cos(theta)``.

    Where psi holds the states is found by the expressions that are a state and nothing else.

    Parameters
    ----------
    name
        What to call it.
    kind
        Name of the robot whose states the expressions use.
    expressions
        The constant ``1`` first; see :mod:`koopman_lab.koopman.expression` for what is allowed.

    Raises
    ------
    ModelError
        If an expression is not allowed or occurs twice, the constant is not the first, or a state
        cannot be told from the observables.
    """
    states = robot_type(kind).state_names
    spellings: list[str] = []
    for text in expressions:
        spelled = canonical(text, states)
        if spelled in spellings:
            raise ModelError(f"dictionary {name}: observable {text!r} occurs twice; drop one")
        spellings.append(spelled)
    if not spellings or spellings[0] not in ("1", "1.0"):
        raise ModelError(
            f"dictionary {name}: the first observable is "
            f"{expressions[0] if spellings else 'missing'!r}, expected the constant '1'"
        )
    rows = {text: row for row, text in enumerate(spellings)}
    missing = [state for state in states if state not in rows and state != "theta"]
    if missing:
        raise ModelError(
            f"dictionary {name}: no observable is the state {missing[0]}, so a prediction could "
            f"not be read off; add {', '.join(map(repr, missing))}"
        )
    cosine, sine = rows.get("cos(theta)"), rows.get("sin(theta)")
    if "theta" not in rows and (cosine is None or sine is None):
        raise ModelError(
            f"dictionary {name}: the angle cannot be read off; add 'theta', or both 'cos(theta)' "
            "and 'sin(theta)'"
        )
    return Dictionary(
        name,
        kind,
        tuple(expressions),
        Expressions(tuple(expressions), tuple(states)),
        tuple(rows.get(state) for state in states),
        None if "theta" in rows else cosine,
        None if "theta" in rows else sine,
    )


_STATE = ("1", *DYNAMIC.state_names)

D5T = from_expressions("D5t", KINEMATIC.name, ("1", "x1", "x2", "cos(theta)", "sin(theta)"))
"""The kinematic robot's dictionary of section 3.4, eq. D5t_kinematic."""
D6_EULER = from_expressions(
    "D6Eul", KINEMATIC.name, ("1", "x1", "x2", "theta", "cos(theta)", "sin(theta)")
)
"""Right-hand side of the Euler-forward step under a constant input.

Section 3.4 names this kind of dictionary as one of the earlier study (Bold et al.) without
listing it: the observables here are the terms of that right-hand side.
"""
D7_MONOMIAL = from_expressions(
    "D7m", KINEMATIC.name, ("1", "x1", "x2", "theta", "theta^2", "theta^3", "theta^4")
)
"""Monomials of the orientation up to order four, as section 3.4 names them of the earlier study."""
D8_EULER = from_expressions("D8Eul", DYNAMIC.name, (*_STATE, "v*cos(theta)", "v*sin(theta)"))
"""From section 3.4, eq. dict_Euler; the dictionaries below are from eq. dict_2order."""
D10_MONOMIAL = from_expressions(
    "D10m", DYNAMIC.name, (*_STATE, "v*omega", "v*theta^2", "v*theta^3", "v*theta^4")
)
D13_TRIGONOMETRIC = from_expressions(
    "D13t",
    DYNAMIC.name,
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
)
D12_FOURIER = from_expressions(
    "D12f",
    DYNAMIC.name,
    _STATE + tuple(f"v*{wave}({k}*theta)" for k in (1, 2, 3) for wave in ("cos", "sin")),
)

DICTIONARIES = {
    d.name: d
    for d in (D5T, D6_EULER, D7_MONOMIAL, D8_EULER, D10_MONOMIAL, D13_TRIGONOMETRIC, D12_FOURIER)
}


def register(custom: Dictionary) -> None:
    """Make a dictionary known by its name, to :func:`dictionary` and to model files.

    Raises
    ------
    ModelError
        If another one has the name already, or its rows do not fit its robot.
    """
    registered = DICTIONARIES.get(custom.name, custom)
    if registered != custom:
        raise ModelError(f"dictionary {custom.name!r}: there is one of this name; choose another")
    angle = custom.state_rows[2] if custom.state_dim > 2 else None
    has_direction_rows = custom.cosine_row is not None and custom.sine_row is not None
    if custom.state_dim != custom.robot.state_dim or (angle is None and not has_direction_rows):
        raise ModelError(
            f"dictionary {custom.name!r}: state_rows need a row for each state of the "
            f"{custom.kind} robot; None only for theta, and then cosine_row and sine_row"
        )
    DICTIONARIES[custom.name] = custom


def dictionary(name: str, kind: str) -> Dictionary:
    """Return a dictionary by its name, or of expressions with commas between them.

    Raises
    ------
    ModelError
        If there is none of this name for the robot; the message lists those there are. If an
        expression is not allowed.
    """
    if "," in name:
        expressions = split(name)
        return from_expressions(f"D{len(expressions)}{CUSTOM}", kind, expressions)
    fitting = [d for d in DICTIONARIES.values() if d.kind == kind]
    for candidate in fitting:
        if candidate.name == name:
            return candidate
    reason = f"is for the {DICTIONARIES[name].kind} robot" if name in DICTIONARIES else "unknown"
    raise ModelError(
        f"dictionary {name!r}: {reason}; for the {kind} robot (states "
        f"{', '.join(robot_type(kind).state_names)}) there are: "
        f"{', '.join(d.name for d in fitting)}, or expressions with commas between them"
    )

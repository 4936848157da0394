"""How pairs of states and successors move, against what the nominal equations call for.

Nothing but the pairs and their input is asked, so that measured data and what a model predicts are
compared alike, of any kind of robot. A planar motion of the frame changes none of the figures.

Where a state holds the body velocity, data sets take it from differences of the same poses. The
displacement then follows from it even where the robot's axis is taken backwards; what tells is how
the input changes the velocity (``rates``), and whether displacements lie along the heading at all.
"""

from __future__ import annotations

import cmath
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from koopman_lab.data.dataset import DataSet
from koopman_lab.geometry.displacement_fit import DisplacementFit, fit_displacements, gain
from koopman_lab.robots.robot_type import POSE_DIM, RobotType

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
CALLED_FOR = 0.2
"""An input that calls for a smaller share of the strongest input's effect calls for none."""


class InputPairs(NamedTuple):
    """States X (d, n), successors Y (d, n), and the ``inputs`` (d, m) that led there."""

    X: Array
    Y: Array
    inputs: Array


@dataclass(frozen=True)
class InputMotion:
    """Under one input, shares of what it calls for; None where it calls for nothing.

    Attributes
    ----------
    pairs
        Number of pairs.
    moved, aside
        Displacement along the nominal one and to the left of it, as shares of its length.
    turned
        Turn, as a share of the nominal one.
    rates
        Change of what stands behind the pose in the state, by its name.
    uncalled
        Mean turn or change that the input does not call for, by its name, as a share of the
        strongest effect of any input.
    errors
        Standard errors of these shares, by ``moved``, ``theta`` and the names of the others: how
        far noise that differs from pair to pair may have led them astray.
    """

    pairs: int
    moved: float | None
    aside: float | None
    turned: float | None
    rates: dict[str, float]
    uncalled: dict[str, float]
    errors: dict[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class NominalMotion:
    """All inputs together, and each by its name.

    Attributes
    ----------
    displacement
        Of all displacements, by those called for.
    heading
        The same of doubled angles, by displacements along the heading, forward or backward; None
        where no velocity comes from poses, as then ``displacement`` says the same.
    turn
        Of all turns, by those called for; None where none is.
    rates
        Of all changes of what stands behind the pose, by its name.
    unexplained
        Root mean square of measured minus nominal displacement, as a share of the measured one.
    step_m
        Root mean square of the measured displacements.
    inputs
        Each input alone.
    """

    displacement: DisplacementFit
    heading: DisplacementFit | None
    turn: float | None
    rates: dict[str, float]
    unexplained: float
    step_m: float
    inputs: dict[str, InputMotion]

    def as_dict(self) -> dict[str, Any]:
        """Return the figures as JSON can hold them; complex factors as size and angle (rad)."""
        return {
            "displacement": _polar(self.displacement),
            "heading": None if self.heading is None else _polar(self.heading),
            "turn": self.turn,
            "rates": self.rates,
            "unexplained": self.unexplained,
            "step_m": self.step_m,
            "inputs": {name: _shares(motion) for name, motion in self.inputs.items()},
        }


class _Effects(NamedTuple):
    """Displacements (d,) in the body's frame, and turn and other changes by name (d,)."""

    displacement: Complex
    changes: dict[str, Array]


def motion_of_data(
    dataset: DataSet, inputs: Mapping[int, Array] | None = None
) -> NominalMotion | None:
    """Return how a data set moves; None if it holds no pairs.

    ``inputs`` are taken in place of the basis inputs, by index.
    """
    stated = dataset.basis_inputs if inputs is None else inputs
    by_input = {
        f"u_{index}": InputPairs(X, dataset.Y[index], np.broadcast_to(stated[index], (len(X), m)))
        for index, X in sorted(dataset.X.items())
        if len(X)
        for m in [len(stated[index])]
    }
    return nominal_motion(by_input, dataset.robot, dataset.dt_s) if by_input else None


def nominal_motion(
    by_input: Mapping[str, InputPairs],
    robot: RobotType,
    dt_s: float,
    *,
    velocity_from_poses: bool = True,
) -> NominalMotion:
    """Compare pairs with the nominal equations.

    Parameters
    ----------
    by_input
        Pairs by a name of their input; none of them empty.
    robot
        Whose states and inputs they are.
    dt_s
        Time from X to Y (s).
    velocity_from_poses
        Whether the velocities in X, where the robot's state holds any, are differences of the
        poses and not known in another way.
    """
    measured = {name: _effects(p.X, p.Y, robot) for name, p in by_input.items()}
    nominal = {
        name: _effects(p.X, robot.step(p.X, p.inputs, dt_s), robot) for name, p in by_input.items()
    }
    theta = {name: np.exp(1j * p.X[:, 2]) for name, p in by_input.items()}
    z = np.concatenate([measured[name].displacement * theta[name] for name in by_input])
    called_for = np.concatenate([nominal[name].displacement * theta[name] for name in by_input])
    changes = ("theta", *robot.state_names[POSE_DIM:])
    gains = {
        change: gain(
            np.concatenate([effect.changes[change] for effect in measured.values()]),
            np.concatenate([effect.changes[change] for effect in nominal.values()]),
        )
        for change in changes
    }
    turn = gains.pop("theta")
    moved_m = float(np.sqrt(np.mean(np.abs(z) ** 2)))
    missing_m = float(np.sqrt(np.mean(np.abs(z - called_for) ** 2)))
    return NominalMotion(
        displacement=fit_displacements(z, called_for),
        heading=(
            _along_heading(z, by_input, robot, dt_s)
            if robot.speeds_at and velocity_from_poses
            else None
        ),
        turn=turn,
        rates={name: value for name, value in gains.items() if value is not None},
        unexplained=missing_m / moved_m if moved_m else 0.0,
        step_m=moved_m,
        inputs=_by_input(measured, nominal),
    )


def _effects(X: Array, Y: Array, robot: RobotType) -> _Effects:
    change = Y - X
    displacement = (change[:, 0] + 1j * change[:, 1]) * np.exp(-1j * X[:, 2])
    rest = range(POSE_DIM, robot.state_dim)
    changes = {"theta": change[:, 2]} | {robot.state_names[i]: change[:, i] for i in rest}
    return _Effects(displacement, changes)


def _along_heading(
    z: Complex, by_input: Mapping[str, InputPairs], robot: RobotType, dt_s: float
) -> DisplacementFit:
    """Fit doubled angles: a robot on wheels moves along its heading, forward or backward."""
    ahead = []
    for pairs in by_input.values():
        x = pairs.X.copy()
        change = pairs.Y - pairs.X
        speeds = np.column_stack([np.hypot(change[:, 0], change[:, 1]), change[:, 2]]) / dt_s
        x[:, list(robot.speeds_at)] = speeds
        moved = robot.step(x, np.zeros_like(pairs.inputs), dt_s) - x
        ahead.append(moved[:, 0] + 1j * moved[:, 1])
    return fit_displacements(_doubled(z), _doubled(np.concatenate(ahead)))


def _doubled(z: Complex) -> Complex:
    """Return numbers of the same size and twice the angle."""
    size = np.abs(z)
    return np.divide(z * z, size, out=np.zeros_like(z), where=size > 0.0)


def _by_input(
    measured: Mapping[str, _Effects], nominal: Mapping[str, _Effects]
) -> dict[str, InputMotion]:
    changes = next(iter(nominal.values())).changes.keys()
    longest_m = max(_rms(effect.displacement) for effect in nominal.values())
    strongest = {
        change: max(_rms(effect.changes[change]) for effect in nominal.values())
        for change in changes
    }
    motions = {}
    for name, effect in nominal.items():
        seen, length_m = measured[name], _rms(effect.displacement)
        errors: dict[str, float] = {}
        moved = None
        if length_m > CALLED_FOR * longest_m:
            along = np.vdot(effect.displacement, seen.displacement)
            moved = complex(along) / float(np.sum(np.abs(effect.displacement) ** 2))
            rest = seen.displacement - moved * effect.displacement
            errors["moved"] = _mean_error(rest) / length_m
        rates: dict[str, float] = {}
        uncalled: dict[str, float] = {}
        for change in changes:
            if not strongest[change]:
                continue
            asked, answer = effect.changes[change], seen.changes[change]
            if _rms(asked) > CALLED_FOR * strongest[change]:
                rates[change] = float(asked @ answer) / float(asked @ asked)
                errors[change] = _mean_error(answer - rates[change] * asked) / _rms(asked)
            else:
                uncalled[change] = float(np.mean(answer - asked)) / strongest[change]
                rest = answer - asked - np.mean(answer - asked)
                errors[change] = _mean_error(rest) / strongest[change]
        motions[name] = InputMotion(
            len(seen.displacement),
            None if moved is None else moved.real,
            None if moved is None else moved.imag,
            rates.pop("theta", None),
            rates,
            uncalled,
            errors,
        )
    return motions


def _mean_error(rest: NDArray[Any]) -> float:
    """Return the standard error of a mean, by what is left of each value without it."""
    return _rms(rest) / float(np.sqrt(max(1, len(rest) - 1)))


def _rms(values: NDArray[Any]) -> float:
    return float(np.sqrt(np.mean(np.abs(values) ** 2)))


def _shares(motion: InputMotion) -> dict[str, Any]:
    return {name: value for name, value in vars(motion).items() if name != "errors"}


def _polar(fit: DisplacementFit) -> dict[str, Any]:
    return {name: cmath.polar(value) for name, value in fit._asdict().items()}

"""Where on the robot the tracked frame is, found in a calibration session, and taken out of poses.

Nobody glues markers exactly above the axle, so the point and the direction that the cameras report
are not those of the paper's kinematics (section 3.1). Before each run the sampler turns the robot
in place and drives it straight ahead, which shows both. While it turns, the tracked point moves on
a circle about the point that stands still; while it drives, that point moves along the robot's
heading, and nowhere else.

The point that stands still while no speed is commanded lies on the wheels' axle. Where one wheel is
larger than the other it is not the axle's middle, but b/2 (r_l - r_r) / (r_l + r_r) to the right of
it (track width b, radii r). No measurement of poses tells the two apart, and none has to: the
kinematics are the same, and it is this point whose speed the wheel odometry reports.

Positions are complex numbers here, x1 + i x2, so that exp(i theta) turns them.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

import lcmtypes
from koopman_lab.data.message_arrays import StructuredArray
from koopman_lab.data.segments import Segment, cut, phase_runs
from koopman_lab.geometry.planar import ORIGIN, Pose, relative_to, wrap_angle

Array = NDArray[np.float64]

SETTLING_S = 0.5
"""Assumption: so long the robot may still roll out from a drive that a rotation ends."""
SMALLEST_TURN_RAD = 0.5
"""Shorter rotations, and pieces of one that lost frames cut up, say less than they disturb."""
SMALLEST_DRIVE_M = 0.1
"""The same for drives."""
FEWEST = 4
"""Rotations, and drives: from fewer, no standard error could be believed."""
LARGEST_ERROR = Pose(0.001, 0.001, 0.005)
"""Standard errors (m, m, rad) beyond which taking out an offset might do more harm than good."""


class MarkerOffset(NamedTuple):
    """What a session says of the tracked frame.

    ``offset`` is its pose in the robot's frame (m ahead, m to the left, rad) with its standard
    ``error``, both None if it cannot be told; ``reason`` then says why and is empty otherwise.
    ``rotations`` and ``drives`` count the stretches of either that were used.
    """

    offset: Pose | None
    error: Pose | None
    rotations: int
    drives: int
    reason: str

    def as_dict(self) -> dict[str, Any]:
        """Return the same as JSON can hold it."""
        return {
            "offset": None if self.offset is None else list(self.offset),
            "standard_error": None if self.error is None else list(self.error),
            "rotations": self.rotations,
            "drives": self.drives,
            "reason": self.reason,
        }


def find_marker(
    states: StructuredArray, frames: StructuredArray, frame_rate_hz: float
) -> MarkerOffset:
    """Return the marker offset of a session.

    Parameters
    ----------
    states
        Messages of SAMPLER_STATE (N,).
    frames
        Messages of MOCAP_POSE (N,).
    frame_rate_hz
        Nominal rate of the cameras.
    """
    phase = lcmtypes.sampler_state_t
    turns = [phase.ROTATE_TO_TARGET, phase.ROTATE_TO_HEADING]
    rotations = [run for turn in turns for run in phase_runs(states, turn)]
    return marker_offset(
        cut(rotations, frames, frame_rate_hz=frame_rate_hz, discard_start_s=SETTLING_S),
        cut(phase_runs(states, phase.DRIVE), frames, frame_rate_hz=frame_rate_hz),
    )


def marker_offset(rotations: Sequence[Segment], drives: Sequence[Segment]) -> MarkerOffset:
    """Fit the marker offset to rotations in place and straight drives.

    Least squares of z_k = c_j + exp(i theta_k) e over all frames k of all rotations j, with a
    centre c_j for each rotation and one e for all, which is the offset in the tracked frame; then
    the mean direction of travel of z - exp(i theta) e in the tracked frame, weighted by distance.
    The standard errors come from how rotations, and drives, differ among each other, as what
    disturbs one of them disturbs all of its frames.

    Parameters
    ----------
    rotations
        Stretches in which the robot turns in place.
    drives
        Stretches in which it drives forward, nearly straight.
    """
    turned = [segment for segment in rotations if _turned_rad(segment) >= SMALLEST_TURN_RAD]
    if len(turned) < FEWEST:
        return _unknown(len(turned), 0, f"{len(turned)} rotations in place, needs {FEWEST}")
    circles = [_circle(segment) for segment in turned]
    weights = np.array([weight for weight, _ in circles])
    singly = np.array([e for _, e in circles])
    e = complex(weights @ singly / weights.sum())
    chords = np.array([_travel(segment, e) for segment in drives], dtype=complex)
    chords = chords[np.abs(chords) >= SMALLEST_DRIVE_M]
    if len(chords) < FEWEST:
        return _unknown(len(turned), len(chords), f"{len(chords)} drives, needs {FEWEST}")
    travel = complex(chords.sum())
    # Seen from the tracked frame, which is turned to the left, the robot drives to the right.
    turn = -cmath.phase(travel)
    position = e * cmath.exp(1j * turn)
    shares = weights / weights.sum()
    position_deviations = (singly * cmath.exp(1j * turn) - position) * shares
    angle_deviations = (chords * cmath.exp(1j * turn)).imag / abs(travel)
    offset = Pose(position.real, position.imag, turn)
    error = Pose(
        _standard_error(position_deviations.real),
        _standard_error(position_deviations.imag),
        _standard_error(angle_deviations),
    )
    if any(deviation > largest for deviation, largest in zip(error, LARGEST_ERROR, strict=True)):
        reason = (
            f"known only to {error.x1 * 1e3:.1f} mm, {error.x2 * 1e3:.1f} mm and "
            f"{math.degrees(error.theta):.2f} deg"
        )
        return _unknown(len(turned), len(chords), reason)
    return MarkerOffset(offset, error, len(turned), len(chords), "")


def without_offset(poses: Array, offset: Pose) -> Array:
    """Return the robot's poses (k, 3) of those of the tracked frame; angles in (-pi, pi]."""
    robot = relative_to(offset, ORIGIN)
    c, s = np.cos(poses[:, 2]), np.sin(poses[:, 2])
    return np.column_stack(
        [
            poses[:, 0] + c * robot.x1 - s * robot.x2,
            poses[:, 1] + s * robot.x1 + c * robot.x2,
            wrap_angle(poses[:, 2] + robot.theta),
        ]
    )


def _unknown(rotations: int, drives: int, reason: str) -> MarkerOffset:
    return MarkerOffset(None, None, rotations, drives, reason)


def _positions_and_headings(segment: Segment) -> tuple[NDArray[np.complex128], Array]:
    """Return positions (k,) and headings (k,) without jumps."""
    x1, x2, theta = segment.poses.T
    return x1 + 1j * x2, np.unwrap(theta)


def _turned_rad(segment: Segment) -> float:
    return float(np.ptp(_positions_and_headings(segment)[1]))


def _circle(segment: Segment) -> tuple[float, complex]:
    """Return how much one rotation says, and what: weight and offset in the tracked frame."""
    z, theta = _positions_and_headings(segment)
    w = np.exp(1j * theta)
    w -= w.mean()
    weight = float(np.sum(np.abs(w) ** 2))
    return weight, complex(np.vdot(w, z - z.mean()) / weight)


def _travel(segment: Segment, e: complex) -> complex:
    """Return the way of one drive, each step of it as seen from the tracked frame."""
    z, theta = _positions_and_headings(segment)
    standing = z - np.exp(1j * theta) * e
    half_way = 0.5 * (theta[1:] + theta[:-1])
    return complex(np.sum(np.diff(standing) * np.exp(-1j * half_way)))


def _standard_error(parts: Array) -> float:
    """Return the standard error of a sum of deviations from their weighted mean."""
    count = len(parts)
    return math.sqrt(count / (count - 1) * float(np.sum(parts**2)))

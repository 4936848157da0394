"""From the poses of a segment to pairs of states and successors (paper, section 5.2).

Every function works on one segment alone, so that nothing of one input leaks into another.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from koopman_lab.data.segments import Segment
from koopman_lab.errors import DataError
from koopman_lab.geometry.planar import TAU
from koopman_lab.robots.robot_type import POSE_DIM, RobotType
from koopman_lab.units import US_PER_S

Array = NDArray[np.float64]
Times = NDArray[np.int64]

MULTIPLE_TOLERANCE = 0.01
"""How far dt may be from a multiple of the frame time and count as one, in frame times."""


class States(NamedTuple):
    """The states of a segment.

    ``utime_us`` (k,) in us; ``x`` (k, n) in the units of the robot's states, the angle continued
    without jumps; ``lateral`` (k,) in m/s, the sideways velocity that a robot on wheels cannot have
    (empty for robots whose states are the pose alone, which need no velocities).
    """

    utime_us: Times
    x: Array
    lateral: Array


class Pairs(NamedTuple):
    """States ``X`` (d, n), the states ``Y`` (d, n) dt later, and the times of X (d,) in us."""

    X: Array
    Y: Array
    start_us: Times


def states(segment: Segment, robot: RobotType, window: int) -> States:
    """Return the states of a segment; with smoothed velocities where the robot's states hold them.

    Positions and angles are never smoothed. Frames whose velocity would need frames outside the
    segment are left out: one at each end for the difference and :func:`margin` for the average.

    Parameters
    ----------
    segment
        Poses of a run.
    robot
        The robot, whose states are the pose, or the pose and the body velocity (v, omega).
    window
        Length of the moving average in frames; poses alone ignore it.

    Raises
    ------
    DataError
        If the robot has states that are neither.
    """
    _require_seen(robot)
    poses = segment.poses.copy()
    poses[:, 2] = np.unwrap(poses[:, 2])
    if not robot.speeds_at:
        return States(segment.utime_us, poses, np.zeros(0))
    if len(poses) < 3 + 2 * margin(window):
        return States(np.zeros(0, np.int64), np.zeros((0, robot.state_dim)), np.zeros(0))
    velocities = moving_average(body_velocities(segment.utime_us, poses), window)
    kept_frames = slice(1 + margin(window), len(poses) - 1 - margin(window))
    x = np.empty((len(velocities), robot.state_dim))
    x[:, :POSE_DIM], x[:, list(robot.speeds_at)] = poses[kept_frames], velocities[:, [0, 2]]
    return States(segment.utime_us[kept_frames], x, velocities[:, 1])


def _require_seen(robot: RobotType) -> None:
    """Refuse a robot with states that poses do not tell."""
    seen = {*range(POSE_DIM), *robot.speeds_at}
    unseen = [name for index, name in enumerate(robot.state_names) if index not in seen]
    if unseen:
        raise DataError(
            f"robot {robot.name}: the cameras do not tell its states {', '.join(unseen)}; data "
            "sets are made of poses and of the body velocity (speeds_at of its description)"
        )


def body_velocities(utime_us: Times, poses: Array) -> Array:
    """Return forward and lateral velocity (m/s) and yaw rate (rad/s), shape (k - 2, 3).

    Central differences of first order (paper, eq. central_difference) at all frames but the first
    and the last, rotated into the robot's frame at the current orientation.

    Parameters
    ----------
    utime_us
        Times (k,) in us.
    poses
        Poses (k, 3) in m, m, rad, the angle without jumps.
    """
    span_s = (utime_us[2:] - utime_us[:-2]) / US_PER_S
    rates = (poses[2:] - poses[:-2]) / span_s[:, None]
    cosine, sine = np.cos(poses[1:-1, 2]), np.sin(poses[1:-1, 2])
    forward = cosine * rates[:, 0] + sine * rates[:, 1]
    lateral = -sine * rates[:, 0] + cosine * rates[:, 1]
    return np.column_stack([forward, lateral, rates[:, 2]])


def margin(window: int) -> int:
    """Return how many values a moving average of this window leaves out at either end."""
    return window // 2


def moving_average(values: Array, window: int) -> Array:
    """Smooth each column of ``values`` (k, m); the result is (k - 2 margin(window), m).

    Only whole windows count: one that shrinks at the ends would bias ramps. A window of odd size
    is the plain mean centred on a value. The mean of an even number of values belongs to a time
    half-way between two of them, so an even window averages its two neighbouring positions, that
    is, it takes in one value more and gives half the weight to the first and the last. Constants
    and ramps pass unchanged either way.
    """
    weights = np.ones(2 * margin(window) + 1)
    if window % 2 == 0:
        weights[[0, -1]] = 0.5
    weights /= window
    if len(values) < len(weights):
        return np.zeros((0, values.shape[1]))
    columns = [np.convolve(column, weights, mode="valid") for column in values.T]
    return np.column_stack(columns)


def pair(segment_states: States, dt_s: float, frame_rate_hz: float) -> Pairs:
    """Match states with their successors by time, at the full rate of the cameras.

    If dt is a multiple of the frame time, the successor is the frame nearest to dt later, which
    must be within half a frame time. Otherwise it is interpolated linearly between the two frames
    around dt later. The angles of X lie in (-pi, pi]; Y is shifted by the same multiple of 2 pi,
    so some angles of Y lie outside.

    Parameters
    ----------
    segment_states
        The states of one segment, no frame missing.
    dt_s
        Sampling time (s).
    frame_rate_hz
        Nominal rate of the cameras.
    """
    utime, x = segment_states.utime_us, segment_states.x
    if not len(utime):
        return Pairs(x, x, utime)
    # Counted from the first frame: in us since the epoch a double resolves only a quarter us.
    elapsed_us = utime - utime[0]
    target_us = elapsed_us + dt_s * US_PER_S
    frames = dt_s * frame_rate_hz
    if round(frames) > 0 and abs(frames - round(frames)) <= MULTIPLE_TOLERANCE:
        nearest = np.rint(np.interp(target_us, elapsed_us, np.arange(len(x)))).astype(np.intp)
        off_us = np.abs(elapsed_us[nearest] - target_us)
        matched = off_us <= 0.5 * US_PER_S / frame_rate_hz
        Y = x[nearest[matched]]
    else:
        matched = target_us <= elapsed_us[-1]
        Y = np.column_stack([np.interp(target_us[matched], elapsed_us, c) for c in x.T])
    X, Y = _shift_angles(x[matched], Y)
    return Pairs(X, Y, utime[matched])


def _shift_angles(X: Array, Y: Array) -> tuple[Array, Array]:
    turns = TAU * np.ceil((X[:, 2] - math.pi) / TAU)
    X, Y = X.copy(), Y.copy()
    X[:, 2] -= turns
    Y[:, 2] -= turns
    return X, Y

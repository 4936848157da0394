"""The pairs of one basis input out of the runs of a session, with an account of what was lost."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from koopman_lab.config.schema import Processing
from koopman_lab.data.processing import pair, states
from koopman_lab.data.segments import Run, Segment
from koopman_lab.errors import DataError
from koopman_lab.robots.robot_type import RobotType
from koopman_lab.units import US_PER_S

LARGEST_RATE_ERROR = 0.1
"""Relative difference between the configured and the measured camera rate that is no jitter."""
INPUT_TOLERANCE = 1e-9


class Collected(NamedTuple):
    """What was found for one basis input.

    ``X`` and ``Y`` (d, n), ``segments`` (d,) with the number of each pair's run, ``start_us`` (d,)
    in us, and ``account`` with counts and the sideways velocity (JSON).
    """

    X: NDArray[np.float64]
    Y: NDArray[np.float64]
    segments: NDArray[np.int64]
    start_us: NDArray[np.int64]
    account: dict[str, Any]


def collect(
    segments: Sequence[Segment],
    robot: RobotType,
    settings: Processing,
    frame_rate_hz: float,
) -> Collected:
    """Return the pairs of all segments under one basis input.

    Parameters
    ----------
    segments
        From :func:`~koopman_lab.data.segments.cut`.
    robot
        The robot whose states the pairs hold.
    settings
        Sampling time and window.
    frame_rate_hz
        Nominal rate of the cameras.
    """
    n = robot.state_dim
    X, Y, numbers, starts = [np.zeros((0, n))], [np.zeros((0, n))], [_NO_TIMES], [_NO_TIMES]
    lateral = [np.zeros(0)]
    for segment in segments:
        segment_states = states(segment, robot, settings.smoothing_window)
        pairs = pair(segment_states, settings.dt_s, frame_rate_hz)
        X.append(pairs.X)
        Y.append(pairs.Y)
        starts.append(pairs.start_us)
        numbers.append(np.full(len(pairs.X), segment.run.number))
        lateral.append(segment_states.lateral)
    sideways = np.concatenate(lateral)
    account = {
        "runs_with_frames": len({segment.run.number for segment in segments}),
        "segments": len(segments),
        "segments_too_short": sum(not len(x) for x in X[1:]),
        "frames": sum(len(segment.poses) for segment in segments),
        "samples": sum(map(len, X)),
        "lateral_rms_m_per_s": float(np.sqrt(np.mean(sideways**2))) if len(sideways) else None,
    }
    return Collected(
        np.concatenate(X),
        np.concatenate(Y),
        np.concatenate(numbers),
        np.concatenate(starts),
        account,
    )


def check_runs(where: str, runs: Sequence[Run], inputs: Mapping[int, Sequence[float]]) -> None:
    """Refuse runs that cannot be of the session the configuration describes.

    Parameters
    ----------
    where
        File and channel, for messages.
    runs
        From :func:`~koopman_lab.data.segments.basis_runs`.
    inputs
        The configured basis inputs by index.

    Raises
    ------
    DataError
        If there is no run, or one with another input than the configuration says.
    """
    if not runs:
        raise DataError(
            f"{where}: no complete run of a basis input; give the log of a session that "
            "`klab calibrate` recorded"
        )
    for run in runs:
        configured = inputs.get(run.basis_index)
        if configured is None or not np.allclose(run.u, configured, 0.0, INPUT_TOLERANCE):
            raise DataError(
                f"{where}: run {run.number} applied {run.u} as basis input {run.basis_index}, "
                f"sampler.basis_inputs says {configured}; use the configuration of this session"
            )


def check_frames(where: str, utime_us: NDArray[np.int64], frame_rate_hz: float) -> None:
    """Refuse frames that do not come at the configured rate.

    Parameters
    ----------
    where
        File and channel, for messages.
    utime_us
        Times of the frames (N,) in us.
    frame_rate_hz
        As configured.

    Raises
    ------
    DataError
        If there are fewer than two frames, or their median distance is not that of the rate.
    """
    steps_us: NDArray[np.int64] = np.diff(np.sort(utime_us)).astype(np.int64)
    steps_us = steps_us[steps_us > 0]
    if not len(steps_us):
        raise DataError(
            f"{where}: {len(utime_us)} camera frames; see whether the cameras were publishing, "
            "and record the session again"
        )
    measured_hz = US_PER_S / float(np.median(steps_us))
    if abs(measured_hz / frame_rate_hz - 1.0) > LARGEST_RATE_ERROR:
        raise DataError(
            f"{where}: frames came at {measured_hz:.1f} Hz, mocap.rate_hz says "
            f"{frame_rate_hz:g}; {_remedy(steps_us, frame_rate_hz)}"
        )


def _remedy(steps_us: NDArray[np.int64], frame_rate_hz: float) -> str:
    """Return what to do about frames that come at another rate, by the steps (k,) between them."""
    factor = US_PER_S / float(np.mean(steps_us)) / frame_rate_hz
    for count, unit in ((1e3, "ms"), (1e-3, "ns")):
        if abs(factor / count - 1.0) < LARGEST_RATE_ERROR:
            return f"their utime seems to be in {unit}, and must be in us"
    if factor > 1.5 and abs(factor - round(factor)) < LARGEST_RATE_ERROR:
        return (
            f"that is {round(factor)} times as many: see with `klab topics` whether a second "
            "publisher speaks, or set mocap.rate_hz to what the cameras deliver"
        )
    return (
        "set mocap.rate_hz to what the cameras deliver and record again, or use the configuration "
        "of this session"
    )


_NO_TIMES: NDArray[np.int64] = np.zeros(0, np.int64)

"""All states along reference runs as starts of predictions (paper, section 5.3)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from koopman_lab.data.reference_trajectories import Trajectory, mean_inputs
from koopman_lab.data.segments import LONGEST_STEP
from koopman_lab.evaluation.metrics import Starts
from koopman_lab.geometry.planar import wrap_angle
from koopman_lab.units import US_PER_S

Array = NDArray[np.float64]


def starts_along(
    trajectories: Sequence[Trajectory], steps: int, dt_s: float, frame_rate_hz: float
) -> Starts:
    """Return every frame of runs from which at least one sampling time was measured.

    Camera frames and commands do not come at the same instants. The input of a sampling time is
    the mean of what was commanded in it, as it changes velocities by just as much.

    Parameters
    ----------
    trajectories
        From :func:`~koopman_lab.data.reference_trajectories.reference_runs`.
    steps
        How far to look ahead.
    dt_s
        Sampling time (s).
    frame_rate_hz
        Nominal rate of the cameras.
    """
    parts = [_starts_of(t, steps, dt_s, frame_rate_hz) for t in trajectories]
    return Starts(
        np.concatenate([p.x0 for p in parts]),
        np.concatenate([p.inputs for p in parts]),
        np.concatenate([p.truth for p in parts]),
        np.concatenate([p.run for p in parts]),
        np.concatenate([p.time_s for p in parts]),
    )


def _starts_of(trajectory: Trajectory, steps: int, dt_s: float, frame_rate_hz: float) -> Starts:
    dt_us = dt_s * US_PER_S
    begins = (trajectory.utime_us >= trajectory.start_us) & (
        trajectory.utime_us <= trajectory.end_us - dt_us
    )
    times = trajectory.utime_us[begins]
    offsets = dt_us * np.arange(steps)
    # Counted from the run's start: in us since the epoch a double resolves only a quarter us.
    since_us = (times - trajectory.start_us).astype(float)
    ends = since_us[:, None] + offsets + dt_us
    truth = _states_at(trajectory, ends, LONGEST_STEP * US_PER_S / frame_rate_hz)
    truth[ends > trajectory.end_us - trajectory.start_us] = np.nan
    inputs = mean_inputs(trajectory, since_us[:, None] + offsets, dt_us)
    x0 = trajectory.x[begins].copy()
    x0[:, 2] = wrap_angle(x0[:, 2])
    known = np.isfinite(truth[:, 0, 0])
    return Starts(
        x0[known],
        inputs[known],
        truth[known],
        np.full(int(known.sum()), trajectory.number),
        since_us[known] / US_PER_S,
    )


def _states_at(trajectory: Trajectory, since_us: Array, longest_us: float) -> Array:
    """Return the states (..., n) at times (...) since the start, between frames that are near."""
    elapsed = (trajectory.utime_us - trajectory.start_us).astype(float)
    if len(elapsed) < 2:
        return np.full((*since_us.shape, trajectory.x.shape[1]), np.nan)
    after = np.clip(np.searchsorted(elapsed, since_us), 1, len(elapsed) - 1)
    gap = elapsed[after] - elapsed[after - 1]
    share = (since_us - elapsed[after - 1]) / gap
    low, high = trajectory.x[after - 1], trajectory.x[after]
    states: Array = low + share[..., None] * (high - low)
    # A state that was measured needs no neighbour.
    states = np.where(
        (share == 1.0)[..., None], high, np.where((share == 0.0)[..., None], low, states)
    )
    unknown = (gap > longest_us) & (share != 0.0) & (share != 1.0)
    states[unknown | (share < 0.0) | (share > 1.0)] = np.nan
    return states

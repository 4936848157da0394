"""Cutting a session into segments: stretches of poses under one constant basis input.

Everything is matched by ``utime``, the time at the source; times of arrival play no part.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

import lcmtypes
from koopman_lab.data.message_arrays import StructuredArray
from koopman_lab.units import US_PER_S

LONGEST_STEP = 1.5
"""A longer step from one frame to the next, in frame times, bridges a missing frame."""


class Run(NamedTuple):
    """One stretch of a phase of the sampler, as a rule one application of a basis input.

    ``number`` counts those of a log from 0; ``u`` is the input, in the units of the robot's inputs,
    at ``start_us``, a basis input until ``end_us`` (us).
    """

    number: int
    basis_index: int
    u: tuple[float, ...]
    start_us: int
    end_us: int


class Segment(NamedTuple):
    """Successive frames of one run, none missing.

    ``utime_us`` (k,) in us, ascending; ``poses`` (k, 3) in m, m, rad, the angle as measured.
    """

    run: Run
    utime_us: NDArray[np.int64]
    poses: NDArray[np.float64]


def basis_runs(states: StructuredArray) -> list[Run]:
    """Return the runs of basis inputs in the messages of SAMPLER_STATE (N,), ordered by time."""
    return phase_runs(states, lcmtypes.sampler_state_t.BASIS)


def completed(runs: Sequence[Run], states: StructuredArray) -> list[Run]:
    """Return the runs after which one more segment counts, those that the sampler did not give up.

    What made it give one up may have acted for a while before it was noticed: a motor loop that
    hears no commands brakes long before its silence is one. Nor does a run count whose end is not
    in the log.

    Parameters
    ----------
    runs
        From :func:`basis_runs`.
    states
        Messages of SAMPLER_STATE (N,).
    """
    states = in_time(states)
    utime, done = states["utime"], states["segments_done"]
    kept = []
    for run in runs:
        first = np.searchsorted(utime, run.start_us)
        after = np.searchsorted(utime, run.end_us)
        # A run whose end was not seen ends with a state of its own; the next one tells.
        newest_count = done[after : after + 2].max(initial=done[first])
        if newest_count > done[first]:
            kept.append(run)
    return kept


def phase_runs(states: StructuredArray, phase: int) -> list[Run]:
    """Return the stretches of one phase in the messages of SAMPLER_STATE (N,), ordered by time.

    A run lasts from the utime of its first state to that of the first state after it. Where that
    state is missing, the run ends with the last state that is known to belong to it.
    """
    states = in_time(states)
    if not len(states):
        return []
    inside = states["phase"] == phase
    same = (
        (inside[1:] == inside[:-1])
        & (states["segment"][1:] == states["segment"][:-1])
        & (states["basis_index"][1:] == states["basis_index"][:-1])
    )
    starts = np.concatenate([[0], np.flatnonzero(~same) + 1])
    stops = np.concatenate([starts[1:], [len(states)]])
    runs: list[Run] = []
    for start, stop in zip(starts[inside[starts]], stops[inside[starts]], strict=True):
        first, last = states[start], states[stop - 1]
        ends_seen = stop < len(states) and states["sequence"][stop] == last["sequence"] + 1
        end_us = states["utime"][stop] if ends_seen else last["utime"]
        u = tuple(first["u"][: first["inputs"]].tolist())
        index = int(first["basis_index"])
        runs.append(Run(len(runs), index, u, int(first["utime"]), int(end_us)))
    return runs


def cut(
    runs: Sequence[Run],
    frames: StructuredArray,
    *,
    frame_rate_hz: float,
    discard_start_s: float = 0.0,
    discard_end_s: float = 0.0,
) -> list[Segment]:
    """Return the segments of runs, ordered by time.

    A run gives one segment, or several where frames are missing or must not be used: nothing is
    ever bridged. A run without a usable frame gives none.

    Parameters
    ----------
    runs
        From :func:`basis_runs`.
    frames
        Messages of MOCAP_POSE (N,).
    frame_rate_hz
        Nominal rate of the cameras.
    discard_start_s, discard_end_s
        What to leave out at either end of each run (s).
    """
    frames = in_time(frames)
    utime = frames["utime"].astype(np.int64)
    poses = np.column_stack([frames["x1_m"], frames["x2_m"], frames["theta_rad"]])
    usable = frames["tracking_valid"] & np.isfinite(poses).all(axis=1)
    longest_us = LONGEST_STEP * US_PER_S / frame_rate_hz
    joined = (
        (np.diff(frames["sequence"]) == 1)
        & (np.diff(utime) <= longest_us)
        & usable[1:]
        & usable[:-1]
    )
    segments = []
    for run in runs:
        first = np.searchsorted(utime, run.start_us + round(discard_start_s * US_PER_S), "left")
        stop = np.searchsorted(utime, run.end_us - round(discard_end_s * US_PER_S), "right")
        breaks = 1 + np.flatnonzero(~joined[first : max(stop - 1, first)])
        pieces = np.split(np.arange(first, stop), breaks)
        segments += [
            Segment(run, utime[piece], poses[piece])
            for piece in pieces
            if len(piece) and usable[piece[0]]
        ]
    return segments


def in_time(messages: StructuredArray) -> StructuredArray:
    """Order messages by utime; of those with the same utime only the first is kept."""
    if np.all(np.diff(messages["utime"]) > 0):
        return messages
    _, order = np.unique(messages["utime"], return_index=True)
    return messages[order]

"""Which poses of a stream can be of one body, given how fast it can move.

Between two frames a body moves by no more than its speed allows. Where it seems to, there is a
jump, and the frames between two jumps, or long pauses, are a piece. Pieces that a body can have
gone through one after another make a track; a piece of which a longer track knows better (that
track was there before and after it) shows something else.
"""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from koopman_lab.geometry.planar import wrap_angle
from koopman_lab.geometry.reach import Reach
from koopman_lab.units import US_PER_S

Array = NDArray[np.float64]
Times = NDArray[np.int64]
Mask = NDArray[np.bool_]

LONGEST_ABSENCE_S = 1.0
"""So long a track may be away; whoever is away for longer may have been carried."""
MOST_TRACKS = 32
"""So many tracks can go on at a time; where there are more, nothing can be told."""
USUAL_STEPS = 10.0
"""A step of so many usual ones, in which the cameras' noise shows, is no jump."""
SLACK_M, SLACK_RAD = (0.01, 0.05), (0.05, 0.5)
"""Assumption: bounds of what noise may add to a step; 0.6 mm and 0.15 deg in preset `harsh`."""


class Tracks(NamedTuple):
    """Of each frame (N,): its track, and the last frame before of a longer track, -1 if none."""

    number: NDArray[np.intp]
    covered_from: NDArray[np.intp]


def reach_of(utime_us: Times, poses: Array, v_m_per_s: float, omega_rad_per_s: float) -> Reach:
    """Return how far a body of this speed can get as poses (N, 3) at times (N,) show it."""
    _, way, turn = _steps(utime_us, poses)
    if not len(way):
        return Reach(v_m_per_s, omega_rad_per_s, SLACK_M[0], SLACK_RAD[0])
    slack_m = float(np.clip(USUAL_STEPS * np.median(way), *SLACK_M))
    slack_rad = float(np.clip(USUAL_STEPS * np.median(turn), *SLACK_RAD))
    return Reach(v_m_per_s, omega_rad_per_s, slack_m, slack_rad)


def jumps(utime_us: Times, poses: Array, reach: Reach) -> Mask:
    """Return whether each frame but the first (N - 1,) cannot follow the one before."""
    possible: Mask = np.asarray(reach.allows(*_steps(utime_us, poses)), bool)
    return ~possible


def tracks(utime_us: Times, poses: Array, reach: Reach) -> Tracks:
    """Sort frames into tracks.

    Parameters
    ----------
    utime_us
        Times (N,) in us, ascending.
    poses
        Poses (N, 3) in m, m, rad.
    reach
        What the body can do.
    """
    covered = np.full(len(poses), -1, np.intp)
    absent = np.diff(utime_us) > LONGEST_ABSENCE_S * US_PER_S
    breaks = 1 + np.flatnonzero(jumps(utime_us, poses, reach) | absent)
    if not len(breaks):
        return Tracks(np.zeros(len(poses), np.intp), covered)
    first = np.concatenate([[0], breaks])
    last = np.concatenate([breaks, [len(poses)]]) - 1
    owner = _linked(utime_us, poses, reach, first, last)
    lengths = np.bincount(owner, last - first + 1)
    pieces_of: dict[int, list[int]] = {}
    for piece, track in enumerate(owner.tolist()):
        pieces_of.setdefault(track, []).append(piece)
    for track, pieces in sorted(pieces_of.items(), key=lambda item: lengths[item[0]]):
        for before, after in pairwise(pieces):
            for piece in range(before + 1, after):
                if lengths[owner[piece]] < lengths[track]:
                    covered[first[piece] : last[piece] + 1] = last[before]
    return Tracks(np.repeat(owner, last - first + 1), covered)


def _linked(
    utime_us: Times,
    poses: Array,
    reach: Reach,
    first: NDArray[np.intp],
    last: NDArray[np.intp],
) -> NDArray[np.intp]:
    """Return the track of each piece: the longest of those that it can go on."""
    owner = np.zeros(len(first), np.intp)
    # Of the tracks that go on, the newest last: number, length, last frame.
    number, length, frame = (np.zeros(0, np.intp) for _ in range(3))
    for piece, (begin, end) in enumerate(zip(first.tolist(), last.tolist(), strict=True)):
        absent_us, change = utime_us[begin] - utime_us[frame], poses[begin] - poses[frame]
        possible = reach.allows(
            absent_us / US_PER_S,
            np.hypot(change[:, 0], change[:, 1]),
            np.abs(wrap_angle(change[:, 2])),
        )
        possible &= absent_us <= LONGEST_ABSENCE_S * US_PER_S
        others, track, size = np.ones(len(number), bool), piece, end - begin + 1
        if possible.any():
            longest = int(np.argmax(np.where(possible, length, 0)))
            others[longest] = False
            track, size = int(number[longest]), size + int(length[longest])
        owner[piece] = track
        others[: max(len(others) - MOST_TRACKS, 0)] = False
        number = np.append(number[others], track)
        length = np.append(length[others], size)
        frame = np.append(frame[others], end)
    return owner


def _steps(utime_us: Times, poses: Array) -> tuple[Array, Array, Array]:
    change = np.diff(poses, axis=0)
    time_s = np.diff(utime_us) / US_PER_S
    return time_s, np.hypot(change[:, 0], change[:, 1]), np.abs(wrap_angle(change[:, 2]))

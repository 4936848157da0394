"""Leaves out the camera frames that cannot show the robot, whatever they say of themselves.

Tracking systems repeat the last pose when they have lost a body, say zeros, take one body for
another, or turn a symmetric set of markers round; all of that is valid by their own account. Frames
are compared with each other, with the wheels, and, where the log holds no wheels, with the basis
inputs. Where most of them contradict the wheels, it is not frames that are wrong but the frame, a
sign or a unit: none is left out for it then, and the verdict on the session names it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from koopman_lab.data.called_for_motion import CalledForMotion
from koopman_lab.data.message_arrays import StructuredArray
from koopman_lab.data.motion_agreement import NOTHING_COMPARED, Agreement, compare_motion
from koopman_lab.data.pose_tracks import jumps, tracks
from koopman_lab.data.segments import Run
from koopman_lab.geometry.planar import wrap_angle
from koopman_lab.geometry.reach import Reach
from koopman_lab.units import US_PER_S

Array = NDArray[np.float64]
Times = NDArray[np.int64]
Codes = NDArray[np.int8]

FAULTS = ("zero", "frozen", "flipped", "jumped", "contradicting")
"""What can be wrong with a frame; code k + 1 stands for the k-th."""
ZERO, FROZEN, FLIPPED, JUMPED, CONTRADICTING = range(1, len(FAULTS) + 1)

FEWEST_FROZEN = 3
"""So many equal poses before a jump were not measured, also where nobody knows how the robot moved
in this run."""
FROZEN_PART_US = 250_000
"""Equal poses are looked at in parts of this length: from the first in which the robot moved for
sure they are old."""
SURELY_MOVED_M, SURELY_TURNED_RAD = 0.25e-3, 1e-3
"""Who moved so far cannot be seen in the very same place; as a camera's resolution (assumption)."""
FLIP_TOLERANCE_RAD = 0.3
MOST_JUMPS = 0.05
"""Share of all steps beyond which jumps are no accidents but another unit, or two bodies in one
stream."""


@dataclass(frozen=True)
class Belief:
    """What is to be believed of frames (N,): code 0, or that of a fault; and how they agree."""

    codes: Codes
    agreement: Agreement


def believe(
    frames: StructuredArray,
    reach: Reach,
    sources: Sequence[CalledForMotion],
    runs: Sequence[Run] = (),
) -> Belief:
    """Look at camera frames.

    Parameters
    ----------
    frames
        Messages of MOCAP_POSE (N,), ascending in time.
    reach
        How far the robot can get.
    sources
        What says how the robot moved, the best first; of each time the first that knows.
    runs
        Runs under basis inputs: in these nobody carries the robot.
    """
    codes = np.zeros(len(frames), np.int8)
    poses = np.column_stack([frames["x1_m"], frames["x2_m"], frames["theta_rad"]])
    utime = frames["utime"].astype(np.int64)
    valid = np.flatnonzero(frames["tracking_valid"] & np.isfinite(poses).all(axis=1))
    if not len(valid):
        return Belief(codes, NOTHING_COMPARED)
    utime, poses = utime[valid], poses[valid]
    seen = _standing(utime, poses, reach, sources, runs)
    kept = np.flatnonzero(seen == 0)
    track = tracks(utime[kept], poses[kept], reach)
    covered = np.flatnonzero(track.covered_from >= 0)
    last_known = kept[track.covered_from[covered]]
    seen[kept[covered]] = _jumped(utime, poses, kept[covered], last_known, reach)
    remaining = np.flatnonzero(track.covered_from < 0)
    kept, numbers = kept[remaining], track.number[remaining]
    broken = kept[1:][jumps(utime[kept], poses[kept], reach)]
    if len(broken) > MOST_JUMPS * len(kept):
        numbers = np.zeros_like(numbers)
    else:
        # Whatever came before it: no pair of states may lie on both sides of a jump.
        seen[broken] = JUMPED
    contradicts, agreement = compare_motion(utime[kept], poses[kept], numbers, sources)
    if not agreement.systematic:
        seen[kept[contradicts]] = CONTRADICTING
    codes[valid] = seen
    return Belief(codes, agreement)


def _standing(
    utime: Times,
    poses: Array,
    reach: Reach,
    sources: Sequence[CalledForMotion],
    runs: Sequence[Run],
) -> Codes:
    """Return the codes of poses that are exactly the one before while the robot moves."""
    codes = np.zeros(len(poses), np.int8)
    equal = np.concatenate([[False], (poses[1:] == poses[:-1]).all(axis=1), [False]])
    first = np.flatnonzero(~equal[:-1] & equal[1:])
    last = np.flatnonzero(equal[:-1] & ~equal[1:])
    jump = np.append(jumps(utime, poses, reach), False)
    for begin, end in zip(first.tolist(), last.tolist(), strict=True):
        caught_up = jump[end] and end - begin + 1 >= FEWEST_FROZEN
        driven = caught_up and any(
            r.start_us <= utime[end] and utime[begin] <= r.end_us for r in runs
        )
        old = begin if driven else _last_true(utime, begin, end, sources)
        if old is not None:
            codes[old + 1 : end + 1] = FROZEN
            if not poses[begin].any():
                codes[old : end + 1] = ZERO
    return codes


def _last_true(
    utime: Times, begin: int, end: int, sources: Sequence[CalledForMotion]
) -> int | None:
    """Return after which of equal poses the robot surely moved on; None if it may have stood."""
    part = (utime[begin : end + 1] - utime[begin]) // FROZEN_PART_US
    parts: list[int] = [begin, *(begin + np.flatnonzero(np.diff(part))).tolist(), end]
    for start, stop in pairwise(parts):
        if stop > start and _surely_moved(int(utime[start]), int(utime[stop]), sources):
            return start
    return None


def _surely_moved(begin_us: int, end_us: int, sources: Sequence[CalledForMotion]) -> bool:
    for source in sources:
        way_m, turn_rad = source.least(begin_us, end_us)
        if not np.isnan(way_m):
            return way_m > SURELY_MOVED_M or turn_rad > SURELY_TURNED_RAD
    return False


def _jumped(
    utime: Times,
    poses: Array,
    wrong: NDArray[np.intp],
    last_known: NDArray[np.intp],
    reach: Reach,
) -> Codes:
    """Return the codes of frames (k,) that are not of the track that was last seen before (k,)."""
    change = poses[wrong] - poses[last_known]
    way, turn = np.hypot(change[:, 0], change[:, 1]), np.abs(wrap_angle(change[:, 2]))
    turned_back = np.maximum(np.pi - turn - FLIP_TOLERANCE_RAD, 0.0)
    flipped = reach.allows((utime[wrong] - utime[last_known]) / US_PER_S, way, turned_back)
    codes = np.where(flipped & (turned_back == 0.0), FLIPPED, JUMPED)
    return np.where(~poses[wrong].any(axis=1), ZERO, codes).astype(np.int8)

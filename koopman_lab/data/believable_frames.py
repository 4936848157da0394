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
from typing import Any

import numpy as np
from numpy.typing import NDArray

from koopman_lab.data.called_for_motion import CalledForMotion
from koopman_lab.data.message_arrays import StructuredArray
from koopman_lab.data.pose_tracks import Reach, jumps, tracks
from koopman_lab.geometry.displacement_fit import DisplacementFit, fit_displacements, gain
from koopman_lab.geometry.planar import wrap_angle
from koopman_lab.units import US_PER_S

Array = NDArray[np.float64]
Times = NDArray[np.int64]
Codes = NDArray[np.int8]

FAULTS = ("zero", "frozen", "flipped", "jumped", "contradicting")
"""What can be wrong with a frame; code k + 1 stands for the k-th."""
ZERO, FROZEN, FLIPPED, JUMPED, CONTRADICTING = range(1, len(FAULTS) + 1)

FEWEST_FROZEN = 3
"""So many equal poses before a jump were not measured, also where nobody knows of any motion."""
SURELY_MOVED_M, SURELY_TURNED_RAD = 0.25e-3, 1e-3
"""Who moved so far cannot be seen in the very same place; as a camera's resolution (assumption)."""
FLIP_TOLERANCE_RAD = 0.3
WINDOW_S, HOP_S, SHORTEST_WINDOW_S = 1.0, 0.25, 0.3
"""Motion is compared over so long, and as often; of shorter tracks over all of them."""
LARGEST_SHARE = 0.5
"""Of what is called for: what is more off contradicts it. Slip, lag and wheels of the wrong size,
three times as bad as in the lab, make 0.1 (preset `harsh`)."""
SLACK_M, SLACK_RAD, LEVER_M = 0.02, 0.1, 0.1
"""Assumptions: what noise and lag may add, and how far the markers may be off the axle."""
NOTABLE_M, NOTABLE_RAD = 0.05, 0.15
"""From here on a motion says something of signs and axes."""
MOST_CONTRADICTING = 0.5
"""Where a larger share of the notable windows contradict, it is the frame that is wrong."""


@dataclass(frozen=True)
class Agreement:
    """How the motion of camera frames agrees with what was called for, over windows of a second.

    Attributes
    ----------
    windows, contradicting
        Windows with notable motion, and those of them that contradict it.
    displacement
        Measured displacements as multiples of those called for.
    turn
        The same of turns; None where there are none.
    """

    windows: int
    contradicting: int
    displacement: DisplacementFit
    turn: float | None

    @property
    def systematic(self) -> bool:
        """Return whether no single frames are to blame."""
        return self.contradicting > MOST_CONTRADICTING * self.windows

    def as_dict(self) -> dict[str, Any]:
        """Return the figures as JSON can hold them, complex numbers as their parts."""
        fit = self.displacement
        return {
            "windows": self.windows,
            "contradicting": self.contradicting,
            "kept": [fit.kept.real, fit.kept.imag],
            "mirrored": [fit.mirrored.real, fit.mirrored.imag],
            "turn": self.turn,
        }


@dataclass(frozen=True)
class Belief:
    """What is to be believed of frames (N,): code 0, or that of a fault; and how they agree."""

    codes: Codes
    agreement: Agreement


def believe(frames: StructuredArray, reach: Reach, sources: Sequence[CalledForMotion]) -> Belief:
    """Look at camera frames.

    Parameters
    ----------
    frames
        Messages of MOCAP_POSE (N,), ascending in time.
    reach
        How far the robot can get.
    sources
        What says how the robot moved, the best first; of each time the first that knows.
    """
    codes = np.zeros(len(frames), np.int8)
    poses = np.column_stack([frames["x1_m"], frames["x2_m"], frames["theta_rad"]])
    utime = frames["utime"].astype(np.int64)
    valid = np.flatnonzero(frames["tracking_valid"] & np.isfinite(poses).all(axis=1))
    if not len(valid):
        return Belief(codes, Agreement(0, 0, DisplacementFit(0.0, 0.0), None))
    utime, poses = utime[valid], poses[valid]
    seen = _standing(utime, poses, reach, sources)
    kept = np.flatnonzero(seen == 0)
    track = tracks(utime[kept], poses[kept], reach)
    covered = np.flatnonzero(track.covered_from >= 0)
    wrong, before = poses[kept[covered]], poses[kept[track.covered_from[covered]]]
    seen[kept[covered]] = _jumped(wrong, before, reach)
    left = np.flatnonzero(track.covered_from < 0)
    kept, numbers = kept[left], track.number[left]
    contradicts, agreement = _against(utime[kept], poses[kept], numbers, sources)
    if not agreement.systematic:
        seen[kept[contradicts]] = CONTRADICTING
    codes[valid] = seen
    return Belief(codes, agreement)


def _standing(
    utime: Times, poses: Array, reach: Reach, sources: Sequence[CalledForMotion]
) -> Codes:
    """Return the codes of poses that are exactly the one before while the robot moves."""
    codes = np.zeros(len(poses), np.int8)
    equal = np.concatenate([[False], (poses[1:] == poses[:-1]).all(axis=1), [False]])
    first = np.flatnonzero(~equal[:-1] & equal[1:])
    last = np.flatnonzero(equal[:-1] & ~equal[1:])
    jump = np.append(jumps(utime, poses, reach), False)
    for begin, end in zip(first.tolist(), last.tolist(), strict=True):
        ends_with_jump = end - begin + 1 >= FEWEST_FROZEN and jump[end]
        if ends_with_jump or _surely_moved(int(utime[begin]), int(utime[end]), sources):
            codes[begin + 1 : end + 1] = FROZEN
            if not poses[begin].any():
                codes[begin : end + 1] = ZERO
    return codes


def _surely_moved(begin_us: int, end_us: int, sources: Sequence[CalledForMotion]) -> bool:
    for source in sources:
        way_m, turn_rad = source.least(begin_us, end_us)
        if not np.isnan(way_m):
            return way_m > SURELY_MOVED_M or turn_rad > SURELY_TURNED_RAD
    return False


def _jumped(poses: Array, before: Array, reach: Reach) -> Codes:
    """Return the codes of poses (k, 3) that a longer track, last seen at ``before``, leaves out."""
    change = poses - before
    near = np.hypot(change[:, 0], change[:, 1]) <= reach.v_m_per_s + reach.slack_m
    turned = np.abs(np.abs(wrap_angle(change[:, 2])) - np.pi) <= FLIP_TOLERANCE_RAD
    codes = np.where(near & turned, FLIPPED, JUMPED)
    return np.where(~poses.any(axis=1), ZERO, codes).astype(np.int8)


def _against(
    utime: Times, poses: Array, track: NDArray[np.intp], sources: Sequence[CalledForMotion]
) -> tuple[NDArray[np.bool_], Agreement]:
    """Return which frames lie in windows that contradict what was called for, and how all agree."""
    first, last = _windows(utime, track)
    begin, end = poses[first], poses[last]
    moved = (end - begin)[:, 0] + 1j * (end - begin)[:, 1]
    seen = moved * np.exp(-1j * begin[:, 2])
    turned = wrap_angle(end[:, 2] - begin[:, 2])
    asked, turn = np.full(len(first), np.nan, complex), np.full(len(first), np.nan)
    for source in sources:
        open_ = np.flatnonzero(np.isnan(turn))
        motion = source.between(utime[first[open_]], utime[last[open_]])
        asked[open_], turn[open_] = motion.displacement, motion.turn
    known = np.flatnonzero(~np.isnan(turn))
    seen, turned, asked, turn = seen[known], turned[known], asked[known], turn[known]
    tolerance_m = LARGEST_SHARE * np.abs(asked) + SLACK_M + LEVER_M * np.abs(turn)
    tolerance_rad = LARGEST_SHARE * np.abs(turn) + SLACK_RAD
    off = np.abs(seen - asked) > tolerance_m
    off |= np.abs(wrap_angle(turned - turn)) > tolerance_rad
    notable = (np.abs(asked) > NOTABLE_M) | (np.abs(turn) > NOTABLE_RAD)
    contradicts = np.zeros(len(utime), bool)
    for window in known[off]:
        contradicts[first[window] : last[window] + 1] = True
    heading = np.exp(1j * begin[known, 2])
    agreement = Agreement(
        int(np.count_nonzero(notable)),
        int(np.count_nonzero(notable & off)),
        fit_displacements((seen * heading)[notable], (asked * heading)[notable]),
        gain(turned[notable], turn[notable]),
    )
    return contradicts, agreement


def _windows(utime: Times, track: NDArray[np.intp]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return the first and the last frame of windows, each of frames of one track."""
    window_us, hop_us = round(WINDOW_S * US_PER_S), round(HOP_S * US_PER_S)
    breaks = 1 + np.flatnonzero(track[1:] != track[:-1])
    firsts = np.concatenate([[0], breaks])
    stops = np.concatenate([breaks, [len(utime)]])
    pairs = [np.zeros((0, 2), np.intp)]
    for first, stop in zip(firsts.tolist(), stops.tolist(), strict=True):
        if stop - first < 2 or utime[stop - 1] - utime[first] < SHORTEST_WINDOW_S * US_PER_S:
            continue
        times = utime[first:stop]
        latest_us = max(times[0], times[-1] - window_us)
        begins_us = np.append(np.arange(times[0], latest_us, hop_us), latest_us)
        pairs.append(
            first
            + np.column_stack(
                [
                    np.searchsorted(times, begins_us),
                    np.searchsorted(times, begins_us + window_us, "right") - 1,
                ]
            )
        )
    windows = np.concatenate(pairs)
    long_enough = utime[windows[:, 1]] - utime[windows[:, 0]] >= SHORTEST_WINDOW_S * US_PER_S
    windows = windows[(windows[:, 1] > windows[:, 0]) & long_enough]
    return windows[:, 0], windows[:, 1]

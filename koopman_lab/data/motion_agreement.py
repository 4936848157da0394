"""How the motion that cameras show agrees with what wheels, or else inputs, call for.

Both are compared over sliding windows of a second, in the frame of the body: long enough for a
motion to stand out from noise, lag and slip, short enough to name the frames that are wrong.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from koopman_lab.data.called_for_motion import CalledForMotion
from koopman_lab.geometry.displacement_fit import DisplacementFit, fit_displacements, gain
from koopman_lab.geometry.planar import wrap_angle
from koopman_lab.units import US_PER_S

Array = NDArray[np.float64]
Times = NDArray[np.int64]
Indices = NDArray[np.intp]

WINDOW_S, HOP_S, SHORTEST_WINDOW_S = 1.0, 0.25, 0.3
"""Motion is compared over so long, and as often; of shorter tracks over all of them."""
LARGEST_SHARE = 0.5
"""Of what is called for: what is more off contradicts it. Slip, lag and wheels of the wrong size,
three times as bad as in the lab, make 0.1 (preset `harsh`)."""
SLACK_M, SLACK_RAD, LEVER_M = 0.02, 0.1, 0.1
"""Assumptions: what noise and lag may add, and how far the markers may be off the axle."""
NOTABLE_M, NOTABLE_RAD = 0.05, 0.15
"""From here on a motion says something of signs and axes."""
FEWEST_WINDOWS = 20
FEW_CONTRADICTING, MOST_CONTRADICTING = 0.1, 0.5
"""Shares of the notable windows: beyond the first, signs tell whether it is the frame that is wrong
and not some of the frames; beyond the second it is in any case."""


@dataclass(frozen=True)
class Agreement:
    """How motion agrees over all windows.

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
        """Return whether no single frames are to blame, but the frame, a sign, a unit, a clock."""
        if self.windows < FEWEST_WINDOWS or self.contradicting < FEW_CONTRADICTING * self.windows:
            return False
        fit = self.displacement
        reversed_ = fit.kept.real < abs(fit.mirrored) or (self.turn is not None and self.turn < 0.0)
        return reversed_ or self.contradicting > MOST_CONTRADICTING * self.windows

    def as_dict(self) -> dict[str, Any]:
        """Return the figures as JSON can hold them, complex numbers as their parts."""
        fit = self.displacement
        return {
            "windows": self.windows,
            "contradicting": self.contradicting,
            "systematic": self.systematic,
            "kept": [fit.kept.real, fit.kept.imag],
            "mirrored": [fit.mirrored.real, fit.mirrored.imag],
            "turn": self.turn,
        }


NOTHING_COMPARED = Agreement(0, 0, DisplacementFit(0.0, 0.0), None)


class Compared(NamedTuple):
    """Whether each frame (N,) lies in a window that contradicts, and how all agree."""

    contradicts: NDArray[np.bool_]
    agreement: Agreement


def compare_motion(
    utime_us: Times, poses: Array, track: Indices, sources: Sequence[CalledForMotion]
) -> Compared:
    """Compare poses with what was called for.

    Parameters
    ----------
    utime_us
        Times (N,) in us, ascending.
    poses
        Poses (N, 3) in m, m, rad.
    track
        Number of the track of each (N,); windows are of one track.
    sources
        What says how the robot moved, the best first; of each window the first that knows.
    """
    first, last = _windows(utime_us, track)
    begin, end = poses[first], poses[last]
    moved = (end - begin)[:, 0] + 1j * (end - begin)[:, 1]
    seen, turned = moved * np.exp(-1j * begin[:, 2]), wrap_angle(end[:, 2] - begin[:, 2])
    asked, turn = np.full(len(first), np.nan, complex), np.full(len(first), np.nan)
    for source in sources:
        unknown = np.flatnonzero(np.isnan(turn))
        motion = source.between(utime_us[first[unknown]], utime_us[last[unknown]])
        asked[unknown], turn[unknown] = motion.displacement, motion.turn
    known = np.flatnonzero(~np.isnan(turn))
    seen, turned, asked, turn = seen[known], turned[known], asked[known], turn[known]
    off = np.abs(seen - asked) > LARGEST_SHARE * np.abs(asked) + SLACK_M + LEVER_M * np.abs(turn)
    off |= np.abs(wrap_angle(turned - turn)) > LARGEST_SHARE * np.abs(turn) + SLACK_RAD
    contradicts = np.zeros(len(utime_us), bool)
    for window in known[off]:
        contradicts[first[window] : last[window] + 1] = True
    notable = (np.abs(asked) > NOTABLE_M) | (np.abs(turn) > NOTABLE_RAD)
    heading = np.exp(1j * begin[known, 2])[notable]
    agreement = Agreement(
        int(np.count_nonzero(notable)),
        int(np.count_nonzero(notable & off)),
        fit_displacements(seen[notable] * heading, asked[notable] * heading),
        gain(turned[notable], turn[notable]),
    )
    return Compared(contradicts, agreement)


def _windows(utime_us: Times, track: Indices) -> tuple[Indices, Indices]:
    """Return the first and the last frame of windows, each of successive frames of one track."""
    window_us, hop_us = round(WINDOW_S * US_PER_S), round(HOP_S * US_PER_S)
    shortest_us = round(SHORTEST_WINDOW_S * US_PER_S)
    pause = np.diff(utime_us) > window_us
    breaks = 1 + np.flatnonzero((track[1:] != track[:-1]) | pause)
    firsts = np.concatenate([[0], breaks])
    lasts = np.concatenate([breaks, [len(utime_us)]]) - 1
    pairs = [np.zeros((0, 2), np.intp)]
    for first, last in zip(firsts.tolist(), lasts.tolist(), strict=True):
        if last <= first or utime_us[last] - utime_us[first] < shortest_us:
            continue
        times = utime_us[first : last + 1]
        latest_us = max(times[0], times[-1] - window_us)
        begins_us = np.append(np.arange(times[0], latest_us, hop_us), latest_us)
        begins = np.searchsorted(times, begins_us)
        ends = np.searchsorted(times, begins_us + window_us, "right") - 1
        pairs.append(first + np.column_stack([begins, ends]))
    windows = np.concatenate(pairs)
    begins, ends = windows[utime_us[windows[:, 1]] - utime_us[windows[:, 0]] >= shortest_us].T
    return begins, ends

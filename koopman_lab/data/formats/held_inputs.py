"""Stretches of a recording in which one input was held: what stands for the sampler's runs.

A command acts until the next one; where none comes any more, for as long as they usually take.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from koopman_lab.units import US_PER_S

LARGEST_DIFFERENCE = 1e-6
"""Of a command from a basis input, relative to it or else in its unit: a float32 keeps 1e-7."""
LONGEST_HOLD_S = 0.5
"""Who commands says so again within this time, or slower than it usually does by no more than a
factor; longer, and the motor loop would have stopped the robot."""
USUAL_PERIODS = 3.0


class HeldInput(NamedTuple):
    """One stretch: commands ``first`` up to ``stop``, the last left out, from start to end (us)."""

    first: int
    stop: int
    start_us: int
    end_us: int


def held_inputs(utime_us: NDArray[np.int64], values: NDArray[np.float64]) -> list[HeldInput]:
    """Return the stretches of equal commands, in the order of time.

    Parameters
    ----------
    utime_us
        Times of the commands (N,) in us, ascending.
    values
        The commands (N, m).
    """
    if not len(utime_us):
        return []
    steps = np.diff(utime_us)
    usual_us = float(np.median(steps)) if len(steps) else LONGEST_HOLD_S * US_PER_S
    longest_us = max(LONGEST_HOLD_S * US_PER_S, USUAL_PERIODS * usual_us)
    goes_on = _equal(values[1:], values[:-1]) & (steps <= longest_us)
    starts = np.concatenate([[0], 1 + np.flatnonzero(~goes_on)])
    stops = np.concatenate([starts[1:], [len(utime_us)]])
    held = []
    for first, stop in zip(starts.tolist(), stops.tolist(), strict=True):
        last_us = int(utime_us[stop - 1])
        following_us = int(utime_us[stop]) if stop < len(utime_us) else None
        end_us = last_us + round(usual_us)
        if following_us is not None and following_us - last_us <= longest_us:
            end_us = following_us
        held.append(HeldInput(first, stop, int(utime_us[first]), end_us))
    return held


def basis_index(u: NDArray[np.float64], inputs: Mapping[int, Sequence[float]]) -> int | None:
    """Return the index of the basis input that a command (m,) is; None if it is none."""
    for index, basis_input in inputs.items():
        if bool(_equal(u[None], np.array([basis_input], float))[0]):
            return index
    return None


def _equal(one: NDArray[np.float64], other: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return which commands (N, m) are those of the same row of others."""
    tolerance = LARGEST_DIFFERENCE * np.maximum(1.0, np.abs(other))
    return np.asarray((np.abs(one - other) <= tolerance).all(axis=1), bool)

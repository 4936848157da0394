"""How far the stamps of the cameras are off those of the wheels that turned with them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from koopman_lab.data.called_for_motion import WheelMotion
from koopman_lab.units import US_PER_S

STEP_US = 50_000
"""Turns are compared in steps of this length, as long as between two messages of the wheels."""
LONGEST_GAP_US = 4 * STEP_US
"""Over longer gaps between frames nothing is known of the turn."""
LONGEST_SPAN_US = 86_400_000_000
"""Whoever speaks for longer than a day had a clock that was set."""
SMALLEST_OFFSET_S = 0.2
"""Smaller ones are lag."""
SMALLEST_CORRELATION = 0.7
"""Assumption: turns that agree less after any shift are not of the same motion."""


def clock_offset_s(
    utime_us: NDArray[np.int64], theta: NDArray[np.float64], wheels: WheelMotion
) -> float | None:
    """Return by how much frames are stamped later than wheels (s).

    None if they fit as they are, or after no shift at all.

    Parameters
    ----------
    utime_us
        Times of frames (N,) in us, ascending.
    theta
        Headings (N,) in rad.
    wheels
        The motion of the wheels.
    """
    if len(utime_us) < 2 or len(wheels) < 2:
        return None
    if max(utime_us[-1] - utime_us[0], wheels.last_us - wheels.first_us) > LONGEST_SPAN_US:
        return None
    seen, rolled = _camera_turns(utime_us, theta), _wheel_turns(wheels)
    energy = float(seen @ seen) * float(rolled @ rolled)
    if not energy:
        return None
    length = len(seen) + len(rolled)
    spectrum = np.fft.rfft(seen, length) * np.conj(np.fft.rfft(rolled, length))
    correlation = np.fft.irfft(spectrum, length) / np.sqrt(energy)
    best = int(np.argmax(correlation))
    if correlation[best] < SMALLEST_CORRELATION:
        return None
    steps = best if best < len(seen) else best - length
    offset_s = (int(utime_us[0]) - wheels.first_us + steps * STEP_US) / US_PER_S
    return offset_s if abs(offset_s) >= SMALLEST_OFFSET_S else None


def _camera_turns(utime_us: NDArray[np.int64], theta: NDArray[np.float64]) -> NDArray[np.float64]:
    elapsed = utime_us - utime_us[0]
    grid = np.arange(0, elapsed[-1] + 1, STEP_US)
    turns = np.diff(np.interp(grid, elapsed, np.unwrap(theta)))
    after = np.clip(np.searchsorted(elapsed, grid[1:]), 1, len(elapsed) - 1)
    return np.where(elapsed[after] - elapsed[after - 1] <= LONGEST_GAP_US, turns, 0.0)


def _wheel_turns(wheels: WheelMotion) -> NDArray[np.float64]:
    grid = np.arange(wheels.first_us, wheels.last_us + 1, STEP_US, dtype=np.int64)
    return np.nan_to_num(wheels.between(grid[:-1], grid[1:]).turn)

"""How regularly a node ticked in real time: periods, missed ticks, and the file of tick times."""

from __future__ import annotations

from array import array
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from koopman_lab.errors import LogError
from koopman_lab.files import replacing
from koopman_lab.units import US_PER_S

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import ArrayLike


class Pacing(NamedTuple):
    """Figures of merit of a tick; times in ms.

    Attributes
    ----------
    ticks, missed, missed_share
        Ticks run, deadlines without one, and their share of all deadlines.
    period_p50_ms, period_p99_ms, period_p999_ms, period_max_ms
        Time between the beginnings of successive ticks.
    error_p99_ms
        What 99 % of the periods are within of the nominal one.
    """

    ticks: int
    missed: int
    missed_share: float
    period_p50_ms: float
    period_p99_ms: float
    period_p999_ms: float
    period_max_ms: float
    error_p99_ms: float


class TickTimes:
    """Keeps when each tick began (us)."""

    def __init__(self) -> None:
        self._times_us = array("q")

    def note(self, now_us: int) -> None:
        """Take the beginning of a tick."""
        self._times_us.append(now_us)

    def save(self, path: Path) -> None:
        """Write the times as an ``.npy`` file of int64 (N,), whole or not at all."""
        import numpy as np

        with replacing(path) as file:
            np.save(file, np.array(self._times_us, np.int64))


def load_tick_times(path: Path) -> np.ndarray[tuple[int], np.dtype[np.int64]]:
    """Read what :meth:`TickTimes.save` wrote.

    Raises
    ------
    LogError
        If the file is missing or damaged.
    """
    from koopman_lab.array_file import ArrayRow, read_array
    from koopman_lab.json_file import Refusal

    refusal = Refusal(path, "tick times", "the process did not end in order", LogError)
    largest = float(2**63)
    return read_array(refusal, ArrayRow("times", "whole", ("ticks",), -largest, largest))


def pacing(times_us: ArrayLike, rate_hz: float) -> Pacing:
    """Return the figures of merit of ticks that began at ``times_us`` (N,), N at least 2.

    Deadlines are ``1 / rate_hz`` apart and a skipped one is never made up for, so those without a
    tick are known from the length of the record.
    """
    import numpy as np

    times = np.asarray(times_us, np.int64)
    periods_ms = np.diff(times) * 1e-3
    deadlines = 1 + round((times[-1] - times[0]) * rate_hz / US_PER_S)
    missed = max(0, deadlines - len(times))
    p50, p99, p999, largest = np.percentile(periods_ms, [50.0, 99.0, 99.9, 100.0]).tolist()
    error_ms = np.abs(periods_ms - 1e3 / rate_hz)
    return Pacing(
        len(times),
        missed,
        missed / deadlines,
        p50,
        p99,
        p999,
        largest,
        float(np.percentile(error_ms, 99.0)),
    )

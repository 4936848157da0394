"""The motion that wheels or inputs call for between two times, to compare camera frames with.

Displacements are complex numbers x1 + i x2 (m) in the frame of the body at the first of the times.
Where nothing is known they are NaN.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from koopman_lab.data.message_arrays import StructuredArray
from koopman_lab.data.segments import Run
from koopman_lab.robots.robot_type import RobotType
from koopman_lab.units import US_PER_S

Array = NDArray[np.float64]
Times = NDArray[np.int64]

LARGEST_GAP_S = 0.2
"""Over longer gaps between messages of WHEEL_STATE nothing is said; four of them."""
AROUND_S = 0.1
"""So much earlier and later the wheels must have turned as well, to be sure that they did: they
average over a window, and the robot follows them late."""


class Motion(NamedTuple):
    """Displacements (k,), complex, in m, and turns (k,) in rad."""

    displacement: NDArray[np.complex128]
    turn: Array


class CalledForMotion(Protocol):
    """What the robot should have done."""

    def between(self, begin_us: Times, end_us: Times) -> Motion:
        """Return the motion from times (k,) to times (k,), in us."""

    def least(self, begin_us: int, end_us: int) -> tuple[float, float]:
        """Return the way (m) and the turn (rad) that the robot made for sure; NaN if unknown."""


class WheelMotion:
    """Motion by the wheels' odometry.

    Parameters
    ----------
    messages
        Messages of WHEEL_STATE (K,) in order of arrival. Where the board's clock was set, what
        overlaps in time is left out.
    """

    def __init__(self, messages: StructuredArray) -> None:
        utime = messages["utime"].astype(np.int64)
        if len(utime):
            latest, earliest = np.maximum.accumulate(utime), np.minimum.accumulate(utime[::-1])
            messages = messages[(utime == latest) & (utime == earliest[::-1])]
            _, first = np.unique(messages["utime"], return_index=True)
            messages = messages[first]
        self._utime = messages["utime"].astype(np.int64)
        self._v, self._omega = messages["v_m_per_s"], messages["omega_rad_per_s"]
        steps_s = np.diff(self._utime) / US_PER_S
        self._way = _integral(self._v, steps_s)
        self._turn = _integral(self._omega, steps_s)
        self._gaps = np.concatenate([[0], np.cumsum(steps_s > LARGEST_GAP_S)])

    def __len__(self) -> int:
        return len(self._utime)

    @property
    def first_us(self) -> int:
        """Return the time (us) of the first message; there must be one."""
        return int(self._utime[0])

    @property
    def last_us(self) -> int:
        """Return the time (us) of the last message; there must be one."""
        return int(self._utime[-1])

    def between(self, begin_us: Times, end_us: Times) -> Motion:
        """Return the motion from times (k,) to times (k,), in us."""
        if len(self) < 2:
            nothing = np.full(len(begin_us), np.nan)
            return Motion(nothing.astype(complex), nothing)
        way = self._at(end_us, self._way) - self._at(begin_us, self._way)
        turn = self._at(end_us, self._turn) - self._at(begin_us, self._turn)
        first = np.searchsorted(self._utime, begin_us, "right") - 1
        last = np.searchsorted(self._utime, end_us, "left")
        known = (first >= 0) & (last < len(self))
        inside = np.clip(first, 0, None), np.clip(last, None, len(self) - 1)
        known &= self._gaps[inside[1]] == self._gaps[inside[0]]
        way, turn = np.where(known, way, np.nan), np.where(known, turn, np.nan)
        chord = way * np.sinc(0.5 * turn / np.pi)
        return Motion(np.asarray(chord * np.exp(0.5j * turn), dtype=np.complex128), turn)

    def least(self, begin_us: int, end_us: int) -> tuple[float, float]:
        """Return the way (m) and the turn (rad) at the slowest that the wheels turned."""
        around_us = round(AROUND_S * US_PER_S)
        first = int(np.searchsorted(self._utime, begin_us - around_us))
        stop = int(np.searchsorted(self._utime, end_us + around_us, "right"))
        if stop - first < 2 or self._gaps[stop - 1] != self._gaps[first]:
            return np.nan, np.nan
        span_s = (end_us - begin_us) / US_PER_S
        v, omega = self._v[first:stop], self._omega[first:stop]
        return float(np.abs(v).min()) * span_s, float(np.abs(omega).min()) * span_s

    def _at(self, utime: Times, values: Array) -> Array:
        start = self._utime[0]
        return np.asarray(np.interp(utime - start, self._utime - start, values))


class InputMotion:
    """Motion by the basis inputs of a session's runs, where the input alone says it.

    A robot that drifts moves on with a velocity that no input tells; of it is only known that it
    cannot have stood still under an input that changes its velocity.

    Parameters
    ----------
    runs
        The session's runs under basis inputs.
    robot
        Whose inputs they are.
    settling_s
        So long after the beginning of a run the robot may not yet follow its input (s).
    """

    def __init__(self, runs: Sequence[Run], robot: RobotType, settling_s: float) -> None:
        self._robot = robot
        settling_us = round(settling_s * US_PER_S)
        self._starts = np.array([run.start_us + settling_us for run in runs], np.int64)
        self._ends = np.array([run.end_us for run in runs], np.int64)
        self._inputs = np.array([run.u for run in runs], float).reshape(-1, robot.input_dim)

    def between(self, begin_us: Times, end_us: Times) -> Motion:
        """Return the motion from times (k,) to times (k,), in us, from rest or without drift."""
        turn = np.full(len(begin_us), np.nan)
        motion = Motion(turn.astype(complex), turn)
        if self._robot.drifts:
            return motion
        for place, (begin, end) in enumerate(zip(begin_us.tolist(), end_us.tolist(), strict=True)):
            moved = self._from_rest(begin, end)
            if moved is not None:
                motion.displacement[place], motion.turn[place] = complex(*moved[:2]), moved[2]
        return motion

    def least(self, begin_us: int, end_us: int) -> tuple[float, float]:
        """Return the way (m) and the turn (rad) that the input makes of a rest.

        Of a time that lies inside a run in part, that part counts.
        """
        run = int(np.searchsorted(self._starts, end_us)) - 1
        if run < 0 or begin_us >= self._ends[run]:
            return np.nan, np.nan
        inside = max(begin_us, int(self._starts[run])), min(end_us, int(self._ends[run]))
        moved = self._from_rest(*inside)
        assert moved is not None  # by what is inside
        return float(np.hypot(moved[0], moved[1])), abs(float(moved[2]))

    def _from_rest(self, begin_us: int, end_us: int) -> Array | None:
        run = int(np.searchsorted(self._starts, begin_us, "right")) - 1
        if run < 0 or end_us > self._ends[run]:
            return None
        rest = self._robot.state((0.0, 0.0, 0.0))
        return self._robot.step(rest, self._inputs[run], (end_us - begin_us) / US_PER_S)


def _integral(speed: Array, steps_s: Array) -> Array:
    """Return the integral (K,) of a speed (K,) up to each time."""
    if not len(speed):
        return np.zeros(0)
    return np.concatenate([[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]) * steps_s)])

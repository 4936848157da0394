"""Whether a wheel does what its motor is told: measured speed against duty and set-point."""

from __future__ import annotations

import math
from enum import Enum, auto

from onboard.motor_loop.running_on import RunningOn, noise_rad_per_s

MOST_OF_BELIEVED = 4.0
"""Assumption: no motor turns a wheel so many times as fast as feed-forward believes; preset `real`
allows for twice as fast."""
MOST_BEHIND_S = 0.2
"""In which even a slow motor at full duty gains more than that noise."""
MUCH_SLOWER = 0.5
"""Share of its set-point below which a wheel at full duty is much slower than that."""


class Contradiction(Enum):
    """In what a wheel's speed contradicts its duty and its set-point."""

    CONTRARY = auto()
    """It turns against its duty, or faster than that can drive it, and does not slow down."""
    TOO_FAST = auto()
    """It is much faster than its set-point, is driven on, and does not slow down."""
    TOO_SLOW = auto()
    """It is much slower than its set-point at full duty, and does not speed up."""


class WheelPlausibility:
    """Judges one wheel tick by tick, on a level floor; of the motor it knows next to nothing.

    A wheel that turns against its duty is being braked, or a sign is wrong: its motor's, its
    encoder's, or one of them is another wheel's. A braked wheel slows down at least as if it were
    running out; as long as it does not, doubt grows (:class:`RunningOn`).

    The same holds for a wheel with so small a duty that its motor would have to be
    :data:`MOST_OF_BELIEVED` times as fast as believed to keep it at its speed: where left and right
    are exchanged, a wheel that is too fast gets less and less duty, and yet does not slow down. And
    it holds for one that is faster than its set-point by more than the fastest set-point there is.

    Who pushes a robot along against its motors, or lets it drive down a slope on which they must
    brake all the time, is found as well.

    Parameters
    ----------
    one_count_rad_per_s
        Speed at which the wheel makes one count a tick.
    full_duty_rad_per_s
        Speed that feed-forward believes the motor to have at full duty.
    fastest_rad_per_s
        Largest set-point.
    """

    def __init__(
        self, one_count_rad_per_s: float, full_duty_rad_per_s: float, fastest_rad_per_s: float
    ) -> None:
        self._noise = noise_rad_per_s(one_count_rad_per_s)
        self._most = MOST_OF_BELIEVED * full_duty_rad_per_s
        self._fastest = fastest_rad_per_s
        self._running_on = RunningOn(self._noise)
        self._best, self._behind_s = -math.inf, 0.0

    @property
    def doubt(self) -> float:
        """Return the doubt that the wheel is braked: 0 none, 1 sure that it is not."""
        return self._running_on.doubt

    @property
    def is_settled(self) -> bool:
        """Return whether nothing of the past counts."""
        return not self._running_on.began and self._best == -math.inf

    def reset(self) -> None:
        """Forget the past."""
        self._running_on.ends()
        self._keeps_up()

    def judge(
        self, duty: float, setpoint: float, speed: float, passed_s: float
    ) -> Contradiction | None:
        """Return how the wheel contradicts its motor, None if it does not, or not for sure.

        Parameters
        ----------
        duty
            Of the past tick, in [-1, 1].
        setpoint, speed
            What the past tick was to bring, and its mean as measured (rad/s).
        passed_s
            Length of the tick.
        """
        size, push = abs(speed), duty * speed
        if duty and self._most * push < size * size and size > self._noise:
            contradiction = Contradiction.CONTRARY
        elif push > 0.0 and size > abs(setpoint) + self._fastest:
            contradiction = Contradiction.TOO_FAST
        else:
            if self._running_on.began:
                self._running_on.ends()
            if -1.0 < duty < 1.0:
                if self._best != -math.inf:
                    self._keeps_up()
                return None
            return self._behind(setpoint, size, passed_s)
        self._keeps_up()
        return contradiction if self._running_on.is_sure(size, abs(duty), passed_s) else None

    def _behind(self, setpoint: float, size: float, passed_s: float) -> Contradiction | None:
        """Judge a wheel at full duty."""
        if size >= MUCH_SLOWER * abs(setpoint):
            self._keeps_up()
        elif size > self._best + self._noise:
            self._best, self._behind_s = size, 0.0
        else:
            self._behind_s += passed_s
            if self._behind_s >= MOST_BEHIND_S:
                return Contradiction.TOO_SLOW
        return None

    def _keeps_up(self) -> None:
        self._best, self._behind_s = -math.inf, 0.0

"""Whether something that is braked slows down: the doubt that motor-loop judgements share."""

from __future__ import annotations

import math

RUN_OUT_S = 0.6
"""Assumption: every wheel that is driven less than its speed takes slows down with this time
constant at least; twice the largest lag that the gains of preset `real` are made for."""
MOST_TIME_S = 0.1
MOST_EFFORT_S = 0.02
"""Of |duty|, summed over time."""
MOST_TURN_RAD = 0.5
"""Time, effort and turn of the wheel, any of which suffices to be sure of a contradiction. Wheels
that obey come to less than half of it: tests/onboard/test_wheels_that_obey.py."""
COUNTS_OF_NOISE = 1.5
"""Between two ticks a steady wheel's counts differ by one."""
NOISE_RAD_PER_S = 0.4
"""Assumption: a wheel runs no smoother, however fine its encoder is."""


def noise_rad_per_s(one_count_rad_per_s: float) -> float:
    """Return by how much a steady wheel's measured speed differs from tick to tick at most.

    Parameters
    ----------
    one_count_rad_per_s
        Speed at which the wheel makes one count a tick.
    """
    return max(NOISE_RAD_PER_S, COUNTS_OF_NOISE * one_count_rad_per_s)


class RunningOn:
    """Doubts, tick by tick, a speed that should fall and does not.

    What is braked slows down at least as if it were running out. So from the first tick on there
    is a speed, falling with :data:`RUN_OUT_S`, that it does not exceed. For as long as it does,
    doubt grows: with time, with the effort that was in vain, and with the turn of the wheel, so
    that the harder it is driven and the faster it turns the sooner it is found.

    Attributes
    ----------
    began
        Whether something is braked now.
    doubt
        0 none, 1 sure.
    """

    def __init__(self, noise_rad_per_s: float) -> None:
        self._noise = noise_rad_per_s
        self.ends()

    def ends(self) -> None:
        """Forget the past: nothing is braked."""
        self.began, self._bound, self.doubt = False, math.inf, 0.0

    def is_sure(self, speed: float, duty: float, passed_s: float) -> bool:
        """Take one more tick of braking; return whether the doubt has become certainty.

        Parameters
        ----------
        speed, duty
            Of the tick, without sign (rad/s, share).
        passed_s
            Its length.
        """
        self.began = True
        bound = min(self._bound, speed)
        self._bound = bound * (1.0 - passed_s / RUN_OUT_S)
        if speed <= bound + self._noise:
            return False
        self.doubt += passed_s * (1.0 / MOST_TIME_S + duty / MOST_EFFORT_S + speed / MOST_TURN_RAD)
        return self.doubt >= 1.0

"""Estimates the delay of the control loop: from a step until its command acts."""

from __future__ import annotations

from collections import deque
from statistics import median

from koopman_lab.config.schema import LabConfig
from koopman_lab.units import US_PER_S

LONGEST_ROUND_TRIP_US = US_PER_S
"""The board takes no later answers."""
LONGEST_S = 1.0
"""Over a longer delay nothing is predicted: who stalls for so long is stopped by the board."""
SOLVES = 20
"""Of which the median counts: a second of them, so that one stall moves nothing."""


class LoopDelay:
    """Estimates the time from a step of the controller until the motor loop applies its command.

    It is the time of a solve, half the radio's round trip, and half a tick of the motor loop. The
    motors' own lag is not part of it: that belongs to the robot, and to a model learned from it.

    Parameters
    ----------
    config
        The lab.
    """

    def __init__(self, config: LabConfig) -> None:
        self._half_tick_s = 0.5 / config.motor_loop.rate_hz
        self._one_way_s = 0.0
        self._solves_s: deque[float] = deque(maxlen=SOLVES)

    def set_round_trip(self, round_trip_us: int) -> None:
        """Take the round trip that the board measured (us); what none can be counts for nothing."""
        if 0 <= round_trip_us <= LONGEST_ROUND_TRIP_US:
            self._one_way_s = 0.5 * round_trip_us / US_PER_S

    def add_step_duration(self, solve_s: float) -> None:
        """Take the time from the beginning of a step until its command was sent (s)."""
        self._solves_s.append(solve_s)

    @property
    def after_sending_s(self) -> float:
        """From the sending of a command until it acts (s)."""
        return self._one_way_s + self._half_tick_s

    def estimate_s(self) -> float:
        """Return the delay to expect of the next command (s)."""
        solve_s = median(self._solves_s) if self._solves_s else 0.0
        return min(LONGEST_S, solve_s + self.after_sending_s)

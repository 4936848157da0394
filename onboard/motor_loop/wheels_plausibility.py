"""Whether both wheels do what their motors are told: each by itself, and as a pair."""

from __future__ import annotations

from collections.abc import Sequence

from koopman_lab.bus.motor_loop_faults import Fault
from onboard.motor_loop.running_on import noise_rad_per_s
from onboard.motor_loop.wheel_pair import LEFT, RIGHT, WheelPairPlausibility
from onboard.motor_loop.wheel_plausibility import (
    MOST_OF_BELIEVED,
    Contradiction,
    WheelPlausibility,
)

FAULTS = {
    (LEFT, Contradiction.CONTRARY): Fault.LEFT_WHEEL_CONTRARY,
    (RIGHT, Contradiction.CONTRARY): Fault.RIGHT_WHEEL_CONTRARY,
    (LEFT, Contradiction.TOO_FAST): Fault.LEFT_WHEEL_TOO_FAST,
    (RIGHT, Contradiction.TOO_FAST): Fault.RIGHT_WHEEL_TOO_FAST,
    (LEFT, Contradiction.TOO_SLOW): Fault.LEFT_WHEEL_TOO_SLOW,
    (RIGHT, Contradiction.TOO_SLOW): Fault.RIGHT_WHEEL_TOO_SLOW,
}
NO_FAULT = Fault.NO_FAULT


class WheelsPlausibility:
    """Asks the judgements of each wheel and of the pair, where there is anything to judge.

    Nearly always there is nothing: neither wheel goes against its duty, and what lies between them
    goes the way of the difference and the sum of their duties. That is seen here at once, since it
    is asked a hundred times a second.

    Parameters
    ----------
    one_count_rad_per_s, full_duty_rad_per_s, fastest_rad_per_s
        As of :class:`WheelPlausibility`.
    """

    def __init__(
        self, one_count_rad_per_s: float, full_duty_rad_per_s: float, fastest_rad_per_s: float
    ) -> None:
        self._wheels = tuple(
            WheelPlausibility(one_count_rad_per_s, full_duty_rad_per_s, fastest_rad_per_s)
            for _ in (LEFT, RIGHT)
        )
        self._pair = WheelPairPlausibility(one_count_rad_per_s)
        noise = noise_rad_per_s(one_count_rad_per_s)
        most = MOST_OF_BELIEVED * full_duty_rad_per_s
        self._thresholds = noise * noise, most, fastest_rad_per_s * fastest_rad_per_s
        """Below which nothing is judged: squares of speeds, but the second."""
        self._is_settled = True
        """Whether no judgement remembers anything."""

    @property
    def doubt(self) -> float:
        """Return the largest doubt: 0 none, 1 sure."""
        return max(self._pair.doubt, *(wheel.doubt for wheel in self._wheels))

    def reset(self) -> None:
        """Forget the past."""
        for wheel in self._wheels:
            wheel.reset()
        self._pair.reset()
        self._is_settled = True

    def judge(
        self,
        duties: Sequence[float],
        setpoints: Sequence[float],
        speeds: Sequence[float],
        passed_s: float,
    ) -> Fault:
        """Return what is wrong with a wheel, NO_FAULT if nothing is, or not for sure.

        Parameters
        ----------
        duties
            Of the past tick, (left, right).
        setpoints, speeds
            What it was to bring, and its mean speeds as measured (rad/s), (left, right).
        passed_s
            Length of the tick.
        """
        if self._is_settled:
            (left_duty, right_duty), (left, right) = duties, speeds
            noise, most, fastest = self._thresholds
            left_squared, right_squared = left * left, right * right
            lead, total = left - right, left + right
            if (
                left_duty * left_duty < 1.0 > right_duty * right_duty
                and left_squared <= fastest >= right_squared
                and (most * left_duty * left >= left_squared or left_squared <= noise)
                and (most * right_duty * right >= right_squared or right_squared <= noise)
                and (lead * (left_duty - right_duty) >= 0.0 or lead * lead <= noise)
                and (total * (left_duty + right_duty) >= 0.0 or total * total <= noise)
            ):
                return NO_FAULT
        runaway = self._pair.judge(duties, setpoints, speeds, passed_s)
        if runaway is not None:
            return FAULTS[runaway, Contradiction.CONTRARY]
        for side in (LEFT, RIGHT):
            contradiction = self._wheels[side].judge(
                duties[side], setpoints[side], speeds[side], passed_s
            )
            if contradiction is not None:
                return FAULTS[side, contradiction]
        self._is_settled = self._pair.is_settled and all(w.is_settled for w in self._wheels)
        return NO_FAULT

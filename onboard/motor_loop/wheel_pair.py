"""Whether both wheels together do what both motors together are told."""

from __future__ import annotations

from collections.abc import Sequence

from onboard.motor_loop.running_on import RunningOn, noise_rad_per_s

LEFT, RIGHT = 0, 1
MOST_UNLIKE = 0.33
"""Assumption: so much of their mean duty two motors need in difference to turn alike, at most. Then
one is 1.4 times as strong as the other; in preset `harsh` it is 1.24 times."""
MOST_FRICTION_DUTY = 0.05
"""Assumption: so much more of a duty friction takes at one wheel than at the other."""


class WheelPairPlausibility:
    """Judges the difference and the sum of both wheels' speeds by those of their duties.

    Where left and right are exchanged, each speed controller drives the other's wheel. The wheels
    drive straight on as they should, but their difference grows, since the slower one's controller
    asks for ever more and so makes the faster one still faster. One wheel by itself looks for long
    as if it had a heavy or an easy way. The pair gives them away: the wheel with the smaller duty
    is the faster one, by more than unlike motors explain, and the other does not catch up. Where
    they are exchanged and reversed as well, they turn in place as they should and their sum grows.

    On a level floor, with motors as unlike as :data:`MOST_UNLIKE` says, a push of that size always
    draws the difference, or the sum, its own way; so what goes the other way slows down. A wheel
    that hardly turns is stuck, which is another judgement's affair.

    Parameters
    ----------
    one_count_rad_per_s
        Speed at which a wheel makes one count a tick.
    """

    def __init__(self, one_count_rad_per_s: float) -> None:
        self._wheel_noise = noise_rad_per_s(one_count_rad_per_s)
        self._noise = 2.0 * self._wheel_noise
        self._difference, self._sum = RunningOn(self._noise), RunningOn(self._noise)

    @property
    def doubt(self) -> float:
        """Return the doubt of the pair: 0 none, 1 sure."""
        return max(self._difference.doubt, self._sum.doubt)

    @property
    def is_settled(self) -> bool:
        """Return whether nothing of the past counts."""
        return not self._difference.began and not self._sum.began

    def reset(self) -> None:
        """Forget the past."""
        self._difference.ends()
        self._sum.ends()

    def judge(
        self,
        duties: Sequence[float],
        setpoints: Sequence[float],
        speeds: Sequence[float],
        passed_s: float,
    ) -> int | None:
        """Return the wheel that is off its set-point the more, None if nothing is wrong for sure.

        Parameters
        ----------
        duties
            Of the past tick, (left, right).
        setpoints, speeds
            What it was to bring, and its mean speeds as measured (rad/s), (left, right).
        passed_s
            Length of the tick.
        """
        (left_duty, right_duty), (left, right) = duties, speeds
        total, push = left + right, left_duty + right_duty
        lead, turn = left - right, left_duty - right_duty
        if lead * turn >= 0.0 and total * push >= 0.0:
            if self._difference.began or self._sum.began:
                self.reset()
            return None
        explained = 0.5 * MOST_UNLIKE * (abs(left_duty) + abs(right_duty)) + MOST_FRICTION_DUTY
        turns = min(abs(left), abs(right)) > self._wheel_noise
        sure = False
        for running_on, speed, duty in (
            (self._difference, lead, turn),
            (self._sum, total, push),
        ):
            against, size, effort = speed * duty < 0.0, abs(speed), abs(duty)
            if against and turns and effort > explained and size > self._noise:
                sure |= running_on.is_sure(size, effort, passed_s)
            else:
                running_on.ends()
        if not sure:
            return None
        left_setpoint, right_setpoint = setpoints
        return LEFT if abs(left - left_setpoint) > abs(right - right_setpoint) else RIGHT

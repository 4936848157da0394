"""The speed controller of one wheel: PID with feed-forward."""

from __future__ import annotations

from koopman_lab.config import motor_loop


class WheelController:
    """PID with feed-forward; speeds in rad/s, the output is a duty in [-1, 1].

    The feed-forward inverts the nominal motor: a first-order lag with Coulomb friction.
    The derivative acts on the filtered measurement, so a step of the set-point does not kick.
    Anti-windup: the integral stands still while the output is limited in its direction.
    """

    def __init__(self, settings: motor_loop.Pid) -> None:
        self._full_speed = settings.feed_forward_full_duty_rad_per_s
        self._lag_s = settings.feed_forward_lag_s
        self._friction_duty = settings.friction_duty
        self._proportional = settings.proportional
        self._integral_per_s = settings.integral_per_s
        self._derivative_s = settings.derivative_s
        self._filter_s = settings.derivative_filter_s
        self.reset()

    def reset(self) -> None:
        """Forget the past."""
        self._integral = 0.0
        self._filtered: float | None = None
        self._setpoint: float | None = None

    def step(self, setpoint: float, measured: float, dt_s: float) -> float:
        """Return the duty for the next ``dt_s`` seconds."""
        filtered, previous = self._filtered, self._setpoint
        if filtered is None or previous is None:
            filtered, previous = measured, setpoint
        change = dt_s / (self._filter_s + dt_s) * (measured - filtered)
        self._filtered = filtered + change
        self._setpoint = setpoint
        rate = (setpoint - previous) / dt_s
        # What was measured is the mean of the past tick, in which the wheel followed ``previous``;
        # held against the new set-point, every ramp would wind up the integral.
        error = previous - measured
        friction = self._friction_duty
        if setpoint <= 0.0:
            friction = -friction if setpoint else 0.0
        unlimited = (
            (setpoint + self._lag_s * rate) / self._full_speed
            + friction
            + self._proportional * error
            + self._integral
            - self._derivative_s * change / dt_s
        )
        limited = 1.0 if unlimited > 1.0 else -1.0 if unlimited < -1.0 else unlimited
        if unlimited == limited or error * unlimited < 0.0:
            self._integral += self._integral_per_s * error * dt_s
        return limited

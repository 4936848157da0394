"""The set-point of the body velocity, and how commands move it."""

from __future__ import annotations

from koopman_lab.config.robot_side import VelocityLimits
from koopman_lab.geometry.planar import REST, Velocity


def saturate(velocity: Velocity, limits: VelocityLimits) -> Velocity:
    """Return the velocity inside the limits that keeps the curvature omega / v.

    Clipping one component alone would drive another circle than the one commanded.
    """
    v, omega = velocity
    excess = max(abs(v) / limits.v_m_per_s, abs(omega) / limits.omega_rad_per_s, 1.0)
    return Velocity(v / excess, omega / excess)


def approach(present: Velocity, target: Velocity, limits: VelocityLimits, dt_s: float) -> Velocity:
    """Return the set-point one tick later on the way to ``target``, within the accelerations.

    Both components are slowed by the same factor, so that the way is a straight line.
    """
    if present == target:
        return target
    dv, d_omega = target.v - present.v, target.omega - present.omega
    excess = max(
        abs(dv) / (limits.a_m_per_s2 * dt_s), abs(d_omega) / (limits.d_omega_rad_per_s2 * dt_s), 1.0
    )
    if excess == 1.0:
        return target
    return Velocity(present.v + dv / excess, present.omega + d_omega / excess)


class AccelerationRamp:
    """Integrates commanded accelerations tick by tick (paper, section 5).

    Each command moves the velocity aimed at for the end of its control interval by
    ``u * interval``; the ticks of the interval walk there in equal parts, starting from the
    present set-point. Without jitter this is plain integration. When commands come a tick early
    or late, as they do over a radio, the sum still equals the sum of the commands. After the
    interval the set-point is held: a silent commander does not go on accelerating the robot.
    """

    def __init__(self, limits: VelocityLimits, interval_s: float, tick_s: float) -> None:
        self._limits = limits
        self._interval_s = interval_s
        self._ticks = max(1, round(interval_s / tick_s))
        self._tick_s = tick_s
        self.reset(REST)

    def reset(self, velocity: Velocity) -> None:
        """Start again from a velocity."""
        self._end = velocity
        self._left = 0

    def command(self, a: float, d_omega: float) -> None:
        """Begin a control interval with accelerations in m/s^2 and rad/s^2."""
        aim = Velocity(
            self._end.v + a * self._interval_s, self._end.omega + d_omega * self._interval_s
        )
        self._end = saturate(aim, self._limits)
        self._left = self._ticks

    def step(self, present: Velocity) -> Velocity:
        """Return the set-point one tick later."""
        aim = self._end
        if self._left > 1:
            share = 1.0 / self._left
            aim = Velocity(
                present.v + share * (aim.v - present.v),
                present.omega + share * (aim.omega - present.omega),
            )
        self._left = max(0, self._left - 1)
        # Commands that arrive in a bunch add up to more than the accelerations allow at once.
        return approach(present, aim, self._limits, self._tick_s)

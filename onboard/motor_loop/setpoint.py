"""The set-point of the body velocity, and how commands move it."""

from __future__ import annotations

from koopman_lab.config.motor_loop import VelocityLimits
from koopman_lab.geometry.planar import REST, Velocity
from koopman_lab.robots.body_drive import BodyDrive


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


class Setpoint:
    """What the wheels are to do, moved tick by tick as the commands say (paper, section 5).

    Each command moves the velocity aimed at, and the set-point walks there within the
    accelerations. Where inputs are accelerations it does so in equal parts over the control
    interval, starting from where it is. Without jitter this is plain integration. When commands
    come a tick early or late, as they do over a radio, the sum still equals the sum of the
    commands. After the interval the set-point is held: a silent commander does not go on
    accelerating the robot.

    Parameters
    ----------
    drive
        What inputs do to the body velocity.
    limits
        Limits of velocities and accelerations.
    interval_s
        Time from one command to the next (s).
    tick_s
        Time from one tick of the motor loop to the next (s).
    """

    def __init__(
        self, drive: BodyDrive, limits: VelocityLimits, interval_s: float, tick_s: float
    ) -> None:
        self._drive = drive
        self._limits = limits
        self._interval_s = interval_s
        self._ticks = max(1, round(interval_s / tick_s)) if drive.integrates else 1
        self._tick_s = tick_s
        self.reset(REST)

    def reset(self, velocity: Velocity) -> None:
        """Start again from a velocity."""
        self.aim = velocity
        """The velocity at the end of the control interval."""
        self._left = 0

    def command(self, u: tuple[float, float]) -> None:
        """Begin a control interval with an input, in the units of the robot's inputs."""
        aim = Velocity(*self._drive.velocity_after(self.aim, u, self._interval_s))
        self.aim = saturate(aim, self._limits)
        self._left = self._ticks

    def step(self, present: Velocity) -> Velocity:
        """Return the set-point one tick later."""
        aim = self.aim
        if self._left > 1:
            share = 1.0 / self._left
            aim = Velocity(
                present.v + share * (aim.v - present.v),
                present.omega + share * (aim.omega - present.omega),
            )
        self._left = max(0, self._left - 1)
        # Commands that arrive in a bunch add up to more than the accelerations allow at once.
        return approach(present, aim, self._limits, self._tick_s)

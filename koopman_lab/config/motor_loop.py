"""The section of the onboard program: rates, health, speed control, limits.

What each value means, its unit and where it comes from is said in ``defaults/*.yaml``.
"""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from koopman_lab.config.values import NotNegative, Positive, Section, Share


class Pid(Section):
    """One wheel's speed controller; the error is in rad/s, the output is a duty in [-1, 1]."""

    proportional: NotNegative
    integral_per_s: NotNegative
    derivative_s: NotNegative
    derivative_filter_s: Positive
    feed_forward_full_duty_rad_per_s: Positive
    feed_forward_lag_s: NotNegative
    friction_duty: NotNegative


class VelocityLimits(Section):
    """Limits of the set-point the motor loop accepts."""

    v_m_per_s: Positive
    omega_rad_per_s: Positive
    a_m_per_s2: Positive
    d_omega_rad_per_s2: Positive


class Health(Section):
    """When the motor loop finds the robot unfit to drive."""

    battery_low_v: NotNegative
    battery_s: NotNegative
    encoder_timeout_s: Positive
    stuck_duty: Share
    stuck_s: Positive


class MotorLoop(Section):
    """The onboard program."""

    rate_hz: Positive
    wheel_state_rate_hz: Positive
    wheel_state_window_s: Positive
    status_rate_hz: Positive
    watchdog_s: Positive
    command_lifetime_s: Positive
    encoder_counts_per_rev: Annotated[int, Field(ge=4)]
    health: Health
    pid: Pid
    limits: VelocityLimits

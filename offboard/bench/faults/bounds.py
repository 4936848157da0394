"""The longest time until the robot must stand after a fault, by what stops it."""

from __future__ import annotations

import math
from collections.abc import Callable

from koopman_lab.config.schema import LabConfig

SETTLE_S = 0.25
"""In which the wheels follow the last of a ramp; the motors' lag is 50 ms."""
COAST_S = 0.4
"""In which motors at zero stop a robot: the logarithm of 0.6 m/s over 1 mm/s, times their lag."""
GUARD_S = 1.0
"""In which the guard of the desk notices that cameras, wheels and commands do not fit together."""
DISOBEYS_S = 0.3
"""In which the motor loop notices that a wheel does not do as it is told."""
ON_THE_WAY_S = 0.05
"""Radio, one camera frame, one tick: what a message or a measurement takes."""

Bound = Callable[[LabConfig], float]


def ramp_s(config: LabConfig) -> float:
    """Return the longest ramp to rest from an allowed set-point, with what follows it (s)."""
    limits = config.motor_loop.limits
    v_s = limits.v_m_per_s / limits.a_m_per_s2
    return max(v_s, limits.omega_rad_per_s / limits.d_omega_rad_per_s2) + SETTLE_S


def by_watchdog(config: LabConfig) -> float:
    """Return the time to rest after the last command (s)."""
    return config.motor_loop.watchdog_s + ON_THE_WAY_S + ramp_s(config)


def by_driver(config: LabConfig) -> float:
    """Return the time to rest after the last motor command (s)."""
    return config.require_simulation().plant.motor.command_timeout_s + ON_THE_WAY_S + COAST_S


def by_estop(config: LabConfig) -> float:
    """Return the time to rest after the motors are set to zero by message (s)."""
    del config
    return ON_THE_WAY_S + COAST_S


def by_stuck_wheel(config: LabConfig) -> float:
    """Return the time to rest after a wheel seems to stand (s), even if it is hardly driven."""
    return config.motor_loop.health.stuck_s + ON_THE_WAY_S + COAST_S


def by_disobeying_wheel(config: LabConfig) -> float:
    """Return the time to rest after a wheel first did not do as it was told (s)."""
    del config
    return DISOBEYS_S + ON_THE_WAY_S + COAST_S


def by_low_battery(config: LabConfig) -> float:
    """Return the time to rest after the battery is low (s)."""
    return config.motor_loop.health.battery_s + ON_THE_WAY_S + COAST_S


def by_guard(config: LabConfig) -> float:
    """Return the time to rest after the motion began to contradict itself (s)."""
    return GUARD_S + ON_THE_WAY_S + ramp_s(config)


def by_guard_after_turning(config: LabConfig) -> float:
    """Return the same (s) for a sampler, which first turns the robot: not every lie shows then."""
    sampler = config.sampler
    turn_s = math.pi / sampler.turn_speed_rad_per_s
    ramps_s = sampler.turn_speed_rad_per_s / sampler.turn_acceleration_rad_per_s2
    return turn_s + ramps_s + SETTLE_S + by_guard(config)


def by_tracking_timeout(config: LabConfig) -> float:
    """Return the time to rest after the cameras told nothing more that counts (s)."""
    return by_controller(config, config.controller.tracking_timeout_s)


def by_controller(config: LabConfig, waits_s: float) -> float:
    """Return the time to rest after the controller's patience (s): it gives the robot up."""
    return waits_s + config.controller.dt_s + ON_THE_WAY_S + ramp_s(config)

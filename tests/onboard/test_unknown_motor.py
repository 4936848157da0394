"""The gains of preset real on motors that nobody has measured."""

import itertools
import math

import pytest
from first_order_drives import FRICTION_DUTIES, FULL_DUTY_RAD_PER_S, LAGS_S

from koopman_lab.config.load import load_config
from onboard.motor_loop.pid import WheelController

REAL = load_config(preset="real").motor_loop
TICK_S = 0.01
SETPOINT_RAD_PER_S = 5.0


def speeds(full_duty_rad_per_s, lag_s, friction_duty, seconds=6.0):
    """Return a wheel's speed, tick by tick, on the steepest ramp that the limits allow.

    The motor is a first-order lag with Coulomb friction, solved exactly over each tick; what is
    measured is the mean speed of the tick before, as from encoder counts.
    """
    wheel, ramp = WheelController(REAL.pid), REAL.limits.a_m_per_s2 / 0.03 * TICK_S
    speed = measured = setpoint = 0.0
    left, rows = math.exp(-TICK_S / lag_s), []
    for _ in range(round(seconds / TICK_S)):
        setpoint = min(SETPOINT_RAD_PER_S, setpoint + ramp)
        duty = wheel.step(setpoint, measured, TICK_S)
        held = friction_duty if speed > 0.0 else min(friction_duty, max(0.0, duty))
        steady = full_duty_rad_per_s * (duty - held)
        measured = max(0.0, steady + (speed - steady) * lag_s / TICK_S * (1.0 - left))
        speed = max(0.0, steady + (speed - steady) * left)
        rows.append(speed)
    return rows


@pytest.mark.parametrize(
    "motor", list(itertools.product(FULL_DUTY_RAD_PER_S, LAGS_S, FRICTION_DUTIES)), ids=str
)
def test_it_comes_to_the_speed_without_swinging(motor):
    rows = speeds(*motor)
    assert max(rows) <= 1.5 * SETPOINT_RAD_PER_S
    settled = rows[round(2.5 / TICK_S) :]
    assert max(abs(speed - SETPOINT_RAD_PER_S) for speed in settled) <= 0.05 * SETPOINT_RAD_PER_S
    last = rows[-100:]
    assert max(last) - min(last) <= 0.01 * SETPOINT_RAD_PER_S

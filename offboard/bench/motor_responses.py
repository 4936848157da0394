"""`klab bench motor`: step, ramp and disturbance responses of the motor loop on the plant."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from koopman_lab.units import US_PER_S
from onboard.motor_loop.command_arbiter import Command, Intent
from onboard.motor_loop.loop import MotorLoop
from onboard.plant.plant import Plant

if TYPE_CHECKING:
    from koopman_lab.config.schema import LabConfig

STEP_M_PER_S, RAMP_M_PER_S2, WEAKER = 0.3, 0.2, 0.8
BAND = 0.02
"""Share of the step within which it counts as settled."""
STEP_S, RAMP_S, DISTURBANCE_S = 2.0, 2.0, 4.0
OPERATOR = 3

Response = NDArray[np.float64]
"""Rows of time (s), set-point v (m/s), true v (m/s), (T, 3)."""


def respond(
    config: LabConfig, u: tuple[float, float], seconds: float, weaker_at_s: float | None = None
) -> Response:
    """Drive from rest with one constant input; return the response, tick by tick.

    Parameters
    ----------
    config
        The lab; its robot's type decides what ``u`` is.
    u
        (m/s, rad/s) or (m/s^2, rad/s^2).
    seconds
        Length of the run.
    weaker_at_s
        Time from which both motors turn with a gain 20 % lower.
    """
    plant, loop = Plant(config, np.random.default_rng(config.seed)), MotorLoop(config)
    rate_hz, factor = config.motor_loop.rate_hz, 1.0
    every = round(config.controller.dt_s * rate_hz)
    rows = []
    for tick in range(round(seconds * rate_hz)):
        now_us = round(tick * US_PER_S / rate_hz)
        plant.advance(now_us)
        loop.encoder(now_us, *plant.encoder_counts(), plant.drives.battery_v())
        if tick % every == 0:
            loop.command(Command(now_us, tick, OPERATOR, Intent.BEGIN, *u), now_us)
        if weaker_at_s is not None and tick >= weaker_at_s * rate_hz:
            factor = WEAKER
        left, right = loop.tick(now_us)
        plant.drive(factor * left, factor * right)
        rows.append((tick / rate_hz, loop.setpoint.v, plant.body_velocity()[0]))
    return np.array(rows)


def responses(kinematic: LabConfig, dynamic: LabConfig) -> dict[str, Response]:
    """Return the step, the ramp and the disturbed run."""
    return {
        "step": respond(kinematic, (STEP_M_PER_S, 0.0), STEP_S),
        "ramp": respond(dynamic, (RAMP_M_PER_S2, 0.0), RAMP_S),
        "disturbance": respond(
            kinematic, (STEP_M_PER_S, 0.0), DISTURBANCE_S, weaker_at_s=DISTURBANCE_S / 2.0
        ),
    }


def figures_of_merit(curves: dict[str, Response]) -> dict[str, float]:
    """Return settling time (s), overshoot, ramp error (m/s), dip and rest of the disturbance."""
    time_s, _, v = curves["step"].T
    final = float(v[len(v) // 2 :].mean())
    outside = np.flatnonzero(np.abs(v - final) > BAND * STEP_M_PER_S)
    _, setpoint, ramp = curves["ramp"].T
    t, _, disturbed = curves["disturbance"].T
    after, last = disturbed[t >= DISTURBANCE_S / 2.0], disturbed[t >= DISTURBANCE_S - 0.5]
    return {
        "step_final_m_per_s": final,
        "step_settled_s": float(time_s[outside[-1] + 1]) if len(outside) else 0.0,
        "step_overshoot": float(v.max() / final - 1.0),
        "ramp_rms_m_per_s": float(np.sqrt(np.mean((ramp - setpoint) ** 2))),
        "disturbance_dip_m_per_s": float(final - after.min()),
        "disturbance_left_m_per_s": float(abs(last.mean() - final)),
    }


def as_table(merit: dict[str, float], preset: str) -> Any:
    """Return the figures of merit for a person."""
    from rich.table import Table

    table = Table("response", title=f"motor loop on the plant, preset {preset}")
    table.add_column("found", justify="right")
    settled, overshoot = merit["step_settled_s"], merit["step_overshoot"]
    table.add_row(f"step to {STEP_M_PER_S} m/s: within 2 % after", f"{settled:.2f} s")
    table.add_row("step: overshoot", f"{100.0 * overshoot:.1f} %")
    ramp = merit["ramp_rms_m_per_s"]
    table.add_row(f"ramp of {RAMP_M_PER_S2} m/s^2: RMS error", f"{1e3 * ramp:.1f} mm/s")
    dip, left = merit["disturbance_dip_m_per_s"], merit["disturbance_left_m_per_s"]
    table.add_row("motors 20 % weaker: dip", f"{1e3 * dip:.1f} mm/s")
    table.add_row("motors 20 % weaker: left after 1.5 s", f"{1e3 * left:.1f} mm/s")
    return table

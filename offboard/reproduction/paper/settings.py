"""What the paper prints of its setting, beside the configuration that the steps ran with."""

from __future__ import annotations

import math
from collections.abc import Sequence

from koopman_lab.robots.kinematic import KINEMATIC
from offboard.reproduction.paper import measures as of
from offboard.reproduction.paper.claim import Claim, Part
from offboard.reproduction.paper.verdict import Same

PLACING = 1e-2
"""Printed in degrees, with two digits."""


def _same(
    name: str,
    section: str,
    says: str,
    paper: str,
    *values: tuple[str, str, float, of.Measure],
    tolerance: float = 1e-3,
) -> Claim:
    parts = [
        Part(part, unit, Same(number, tolerance), measure) for part, unit, number, measure in values
    ]
    return Claim(name, section, says, paper, parts)


def _basis(step: str, section: str, symbol: str, inputs: Sequence[tuple[float, float]]) -> Claim:
    units = ("m/s", "rad/s") if symbol == "v" else ("m/s2", "rad/s2")
    first = 1 if symbol == "v" else 0
    return _same(
        f"{step}-inputs",
        section,
        "Basis inputs of the session",
        ", ".join(f"{symbol}_{first + k} = ({u[0]:g}, {u[1]:g})" for k, u in enumerate(inputs)),
        *(
            (
                f"{symbol}_{first + k}, component {c + 1}",
                units[c],
                u[c],
                of.setting(step, "sampler", "basis_inputs", k, c),
            )
            for k, u in enumerate(inputs)
            for c in range(2)
        ),
    )


def _start(step: str, section: str, what: str, paper: str, pose: Sequence[float]) -> Claim:
    return _same(
        f"{step}-start",
        section,
        f"Start of {what}",
        paper,
        *(
            (name, unit, value, _start_value(step, k))
            for k, (name, unit, value) in enumerate(
                zip(("x1", "x2", "theta"), ("m", "m", "rad"), pose, strict=True)
            )
        ),
    )


def _start_value(step: str, component: int) -> of.Measure:
    return lambda results: float(results.summary(step, "start")[component])


def _draw(
    component: str, low: float, high: float, unit: str
) -> list[tuple[str, str, float, of.Measure]]:
    return [
        (
            f"{component} {side}",
            unit,
            value,
            of.setting("dynamic-session", "sampler", "draw_set", f"{component}_{key}", k),
        )
        for k, (side, value) in enumerate((("from", low), ("to", high)))
        for key in [unit.replace("/", "_per_")]
    ]


SETTINGS = (
    _same(
        "simulation-horizon",
        "4",
        "Horizon of the kinematic controllers",
        "60",
        ("horizon", "", 60.0, of.setting("simulation-models", "controller", "horizon")),
    ),
    _same(
        "simulation-dt",
        "4",
        "Sampling time of the kinematic simulations",
        "0.1 s",
        ("dt", "s", 0.1, of.setting("simulation-models", "controller", "dt_s")),
    ),
    _start(
        "simulation-models",
        "4",
        "the simulation of three models",
        "(-1 m, -0.5 m, -pi/6)",
        (-1.0, -0.5, -math.pi / 6),
    ),
    _start(
        "simulation-parallel",
        "4",
        "the parallel parking",
        "no number; here that of the lab run, (0, 0.5 m, 0)",
        (0.0, 0.5, 0.0),
    ),
    _same(
        "kinematic-duration-of-simulation",
        "4",
        "After which x2 is looked at, kinematic robot",
        "10 s",
        ("duration", "s", 10.0, of.fact("simulation-models", "duration_s")),
    ),
    _same(
        "kinematic-starts",
        "4",
        "Random starts of the kinematic robot",
        "1000",
        ("runs", "", 1000.0, of.runs("kinematic-parking", "me-reprojected")),
    ),
    _same(
        "kinematic-session-dt",
        "4",
        "Sampling time of the kinematic robot in the lab",
        "50 ms",
        ("dt", "s", 0.05, of.setting("kinematic-session", "processing", "dt_s")),
    ),
    _same(
        "kinematic-session-segments",
        "4",
        "Runs for each basis input, kinematic session",
        "5",
        ("runs", "", 5.0, of.setting("kinematic-session", "sampler", "segments_per_basis")),
    ),
    _basis("kinematic-session", "4", "v", ((0.2, -0.4), (0.2, 0.6))),
    _same(
        "kinematic-placing",
        "4",
        "Accuracy of placing the kinematic robot by hand",
        "1 cm, 2 deg",
        ("position", "m", 0.01, of.setting("kinematic-lab", "placement", "position_m")),
        (
            "angle",
            "rad",
            math.radians(2.0),
            of.setting("kinematic-lab", "placement", "angle_rad"),
        ),
        tolerance=PLACING,
    ),
    _same(
        "lab-limit",
        "4",
        "A lab run that has not parked ends after",
        "25 s",
        ("limit", "s", 25.0, of.setting("kinematic-lab", "controller", "time_limit_s")),
    ),
    _same(
        "motor-loop",
        "5",
        "Sampling time of the motor controllers",
        "10 ms",
        ("rate", "Hz", 100.0, of.setting("dynamic-session", "motor_loop", "rate_hz")),
    ),
    _same(
        "draw-set",
        "5.1",
        "Where the states of the session are drawn",
        "[0, 1.5] m x [-0.75, 0.75] m x (-pi, pi] x [0, 0.4] m/s x [-1, 1] rad/s",
        *_draw("x1", 0.0, 1.5, "m"),
        *_draw("x2", -0.75, 0.75, "m"),
        *_draw("theta", -math.pi, math.pi, "rad"),
        *_draw("v", 0.0, 0.4, "m/s"),
        *_draw("omega", -1.0, 1.0, "rad/s"),
    ),
    _same(
        "cameras",
        "5.1",
        "Rate of the cameras",
        "240 Hz",
        ("rate", "Hz", 240.0, of.setting("dynamic-session", "mocap", "rate_hz")),
    ),
    _same(
        "dynamic-dt",
        "5.1",
        "Sampling time of the second-order robot",
        "50 ms",
        ("dt", "s", 0.05, of.setting("dynamic-session", "processing", "dt_s")),
    ),
    _basis("dynamic-session", "5.2", "u", ((0.0, 0.0), (0.2, 0.0), (0.0, 0.5))),
    _same(
        "dynamic-segments",
        "5.2",
        "Runs for each basis input, session of the second-order robot",
        "100",
        ("runs", "", 100.0, of.setting("dynamic-session", "sampler", "segments_per_basis")),
    ),
    _same(
        "window",
        "5.3",
        "Smoothing window",
        "40 frames",
        ("frames", "", 40.0, of.setting("dynamic-session", "processing", "smoothing_window")),
    ),
    _same(
        "reference-runs",
        "5.3",
        "Runs of each reference trajectory",
        "20",
        ("infinity", "", 20.0, of.fact("dynamic-infinity", "runs")),
        ("square", "", 20.0, of.fact("dynamic-square", "runs")),
    ),
    _same(
        "steps-ahead",
        "5.3",
        "How far ahead multi-step errors look",
        "20 steps, 1 s",
        ("steps", "", 20.0, of.most_steps("multistep")),
    ),
    _same(
        "dynamic-horizon",
        "5.4",
        "Horizon of the controllers of the second-order robot",
        "50",
        ("horizon", "", 50.0, of.setting("simulation-dynamic", "controller", "horizon")),
    ),
    _start(
        "simulation-dynamic",
        "5.4",
        "the simulation of the second-order robot",
        "(1 m, 0.2 m, pi/4) at rest",
        (1.0, 0.2, math.pi / 4),
    ),
    _same(
        "dynamic-duration",
        "5.4",
        "After which x2 is looked at, second-order robot",
        "20 s",
        ("duration", "s", 20.0, of.fact("simulation-dynamic", "duration_s")),
    ),
    _same(
        "dynamic-starts",
        "5.4",
        "Random starts of the second-order robot",
        "1000",
        ("runs", "", 1000.0, of.runs("dynamic-parking", "me-reprojected")),
    ),
    _same(
        "dynamic-placing",
        "5.4",
        "Accuracy of placing the second-order robot by hand",
        "7 mm, 5 deg",
        ("position", "m", 0.007, of.setting("dynamic-lab", "placement", "position_m")),
        (
            "angle",
            "rad",
            math.radians(5.0),
            of.setting("dynamic-lab", "placement", "angle_rad"),
        ),
        tolerance=PLACING,
    ),
    _same(
        "wheel-average",
        "5.4",
        "Over which the wheels' speeds are averaged",
        "50 ms",
        ("window", "s", 0.05, of.setting("dynamic-lab", "motor_loop", "wheel_state_window_s")),
    ),
    _same(
        "efficiency-time",
        "6",
        "The least time that so few samples take",
        "10 samples 1 s, 100 samples 5 s",
        (
            "kinematic, 10 samples",
            "s",
            1.0,
            of.scaled(10.0, of.setting("simulation-models", "controller", "dt_s")),
        ),
        (
            "second-order, 100 samples",
            "s",
            5.0,
            of.scaled(100.0, of.setting("dynamic-session", "processing", "dt_s")),
        ),
    ),
    _same(
        "efficiency-starts",
        "6",
        "Random starts for each number of samples",
        "1000",
        (KINEMATIC.name, "", 1000.0, of.runs("data-efficiency", "kinematic-d10")),
        ("second-order", "", 1000.0, of.runs("data-efficiency", "dynamic-d100")),
    ),
)

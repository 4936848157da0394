"""Where, how long and how often commands drive a kind of robot that are not told otherwise."""

from __future__ import annotations

from dataclasses import dataclass
from math import pi

Box = tuple[tuple[float, float], tuple[float, float], tuple[float, float]]
"""Ranges of x1, x2 and theta (m, m, rad)."""


@dataclass(frozen=True)
class StandardRuns:
    """What ``klab`` does with a robot unless an option says it; poses are (m, m, rad).

    Attributes
    ----------
    park_start
        Where `klab park`, `klab demo` and `klab compare` place it.
    simulate_start
        Where `klab simulate`, `klab study weights` and `klab bench ocp` start it, at rest.
    simulate_s
        How long simulations and studies are (s).
    random_starts
        What studies draw poses from; None for the sampler's draw set, X0.
    study_dt_s
        Sampling time (s) at which studies read a session; None for the session's own.
    demo_segments, bench_segments
        Segments per basis input that `klab demo` and `klab bench ocp` record.
    """

    park_start: tuple[float, float, float] = (0.0, 0.5, 0.0)
    simulate_start: tuple[float, float, float] = (-1.0, -0.5, -pi / 6.0)
    simulate_s: float = 10.0
    random_starts: Box | None = None
    study_dt_s: float | None = None
    demo_segments: int = 5
    bench_segments: int = 5

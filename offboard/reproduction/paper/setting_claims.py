"""Claims that a setting of ours is the one which the paper prints."""

from __future__ import annotations

from collections.abc import Sequence

from offboard.reproduction.paper import measures
from offboard.reproduction.paper.claim import Claim, Part
from offboard.reproduction.paper.verdict import Same


def same_as_printed(
    name: str,
    section: str,
    sentence: str,
    paper: str,
    *values: tuple[str, str, float, measures.Measure],
    tolerance: float = 1e-3,
) -> Claim:
    """Return the claim that values are as the paper prints them.

    Parameters
    ----------
    name, section, sentence, paper
        As of :class:`~offboard.reproduction.paper.claim.Claim`.
    values
        Of each number its name, its unit, what the paper prints, and where ours is read.
    tolerance
        Relative, by as many digits as the paper prints.
    """
    parts = [
        Part(part, unit, Same(number, tolerance), measure) for part, unit, number, measure in values
    ]
    return Claim(name, section, sentence, paper, parts)


def basis_inputs(
    step: str, section: str, symbol: str, inputs: Sequence[tuple[float, float]]
) -> Claim:
    """Return the claim that a session was recorded with these basis inputs.

    They are in (m/s, rad/s) where ``symbol`` is "v", and in (m/s^2, rad/s^2) otherwise.
    """
    units = ("m/s", "rad/s") if symbol == "v" else ("m/s2", "rad/s2")
    first = 1 if symbol == "v" else 0
    return same_as_printed(
        f"{step}-inputs",
        section,
        "Basis inputs of the session",
        ", ".join(f"{symbol}_{first + k} = ({u[0]:g}, {u[1]:g})" for k, u in enumerate(inputs)),
        *(
            (
                f"{symbol}_{first + k}, component {c + 1}",
                units[c],
                u[c],
                measures.setting(step, "sampler", "basis_inputs", k, c),
            )
            for k, u in enumerate(inputs)
            for c in range(2)
        ),
    )


def start_pose(step: str, section: str, what: str, paper: str, pose: Sequence[float]) -> Claim:
    """Return the claim that a simulation began at a pose (m, m, rad)."""
    return same_as_printed(
        f"{step}-start",
        section,
        f"Start of {what}",
        paper,
        *(
            (name, unit, value, _start_component(step, k))
            for k, (name, unit, value) in enumerate(
                zip(("x1", "x2", "theta"), ("m", "m", "rad"), pose, strict=True)
            )
        ),
    )


def _start_component(step: str, component: int) -> measures.Measure:
    return lambda results: float(results.summary(step, "start")[component])


def draw_interval(
    component: str, low: float, high: float, unit: str
) -> list[tuple[str, str, float, measures.Measure]]:
    """Return the two ends of an interval of the draw set, as :func:`same_as_printed` takes them."""
    return [
        (
            f"{component} {side}",
            unit,
            value,
            measures.setting("dynamic-session", "sampler", "draw_set", f"{component}_{key}", k),
        )
        for k, (side, value) in enumerate((("from", low), ("to", high)))
        for key in [unit.replace("/", "_per_")]
    ]

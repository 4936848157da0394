"""The table of figures: which one here corresponds to which one of the paper."""

from __future__ import annotations

from typing import NamedTuple


class Picture(NamedTuple):
    """A figure that a step leaves.

    Attributes
    ----------
    step, stem
        Where it is: ``step/stem.png`` and ``.pdf``.
    answers
        Number of the paper's figure; None for one that the paper does not have.
    caption
        What it shows.
    shown
        Whether it is among the few in the page of results (scripts/results).
    """

    step: str
    stem: str
    answers: int | None
    caption: str
    shown: bool = False


PICTURES = (
    Picture(
        "simulation-models",
        "paths",
        2,
        "The kinematic robot parked from (-1 m, -0.5 m, -30 deg) with the model, reprojected and "
        "not, and with the nominal equations: paths and value functions.",
    ),
    Picture(
        "simulation-parallel",
        "paths",
        3,
        "The kinematic robot parked from (0, 0.5 m, 0) with the costs me, ce and ds: paths and "
        "value functions.",
    ),
    Picture(
        "kinematic-parking",
        "distribution",
        4,
        "Empirical distributions of |x2| after 10 s, kinematic robot, random starts.",
        shown=True,
    ),
    Picture(
        "kinematic-lab",
        "paths",
        5,
        "Lab runs of the kinematic robot: paths, value functions, deviation sideways.",
    ),
    Picture(
        "samples",
        "samples",
        6,
        "Samples of each basis input, and velocities smoothed by several windows.",
    ),
    Picture(
        "dictionaries",
        "dictionaries",
        7,
        "Open-loop predictions with four dictionaries along both reference trajectories, and "
        "one-step errors.",
    ),
    Picture(
        "multistep",
        "multistep",
        8,
        "Errors of 1 to 20 steps along the infinity-shaped runs, averaged and largest: with "
        "reprojection, without, and nominal.",
    ),
    Picture(
        "simulation-dynamic",
        "paths",
        9,
        "The second-order robot parked from (1 m, 0.2 m, 45 deg) with the costs me, ce and ds: "
        "paths and value functions.",
    ),
    Picture(
        "dynamic-parking",
        "distribution",
        10,
        "Empirical distributions of |x2| after 20 s, second-order robot, random starts.",
        shown=True,
    ),
    Picture(
        "dynamic-lab",
        "paths",
        11,
        "Lab runs of the second-order robot: paths, value functions, deviation sideways.",
    ),
    Picture(
        "data-efficiency",
        "distribution",
        12,
        "Empirical distributions of |x2| with models of few samples, both robots.",
        shown=True,
    ),
    Picture(
        "simulation-dynamic-long",
        "paths",
        None,
        "Quadratic costs with twice the horizon, with the model and the nominal equations.",
    ),
    Picture("validation", "validation", None, "Errors against how far ahead models predict."),
    Picture("sweep", "sweep", None, "What the smoothing window does to the fit."),
    Picture("needed", "needed", None, "Errors in open loop against the number of samples."),
    Picture(
        "horizon", "distribution", None, "Empirical distributions of |x2| with several horizons."
    ),
    Picture(
        "combination",
        "distribution",
        None,
        "Empirical distributions of |x2| with the paper's combination of inputs and with that of "
        "generators.",
    ),
    Picture(
        "fit",
        "distribution",
        None,
        "Empirical distributions of |x2| with plain, noise-aware and symmetric fits.",
    ),
)
STUDIES = (
    "kinematic-parking",
    "dynamic-parking",
    "data-efficiency",
    "horizon",
    "combination",
    "fit",
)
"""Whose tables the report holds."""
GRIDS = ("weights-kinematic", "weights-dynamic")
"""Studies of weights, whose settings the report sums up by cost."""

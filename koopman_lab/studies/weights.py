"""How the end of a run depends on weights and bounds, which the paper does not print.

Whether a cost brings the robot to the goal must not hang on a lucky choice, so each is run over the
same grid of factors around its configured weights.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from koopman_lab.config.change import changed
from koopman_lab.config.controller import CostName, Weights
from koopman_lab.config.schema import LabConfig
from koopman_lab.koopman.dictionary import Dictionary, dictionary
from koopman_lab.mpc.configured_cost import stage_weights
from koopman_lab.predictors.predictor import PredictionModel
from koopman_lab.robots.table import robot_type
from koopman_lab.studies.closed_loop import closed_loop, x2_last_mm

FACTORS = (0.1, 1.0, 10.0)
"""Factors of the weights of each group."""
BOUND_FACTORS = (0.5, 2.0)
"""Factors of the inputs' bounds, at the configured weights."""
GROUPS = ("x1", "x2", "angle", "inputs")
"""What is weighted together; speeds and their products keep their weights."""


@dataclass(frozen=True)
class Setting:
    """One point of the grid: a cost, a factor for each of :data:`GROUPS`, one for the bounds."""

    cost: CostName
    factors: tuple[float, ...]
    bounds: float = 1.0


@dataclass(frozen=True)
class WeightsRow:
    """How a run with a setting ended.

    ``final`` is the state (x1 in m, x2 in m, theta in rad), ``x2_last_mm`` the largest |x2| of the
    last second, ``unsolved`` the number of steps without a solution.
    """

    setting: Setting
    final: tuple[float, float, float]
    x2_last_mm: float
    unsolved: int


def settings(costs: Sequence[CostName], factors: Sequence[float] = FACTORS) -> list[Setting]:
    """Return the grid: every combination of factors, then the bounds alone."""
    plain = (1.0,) * len(GROUPS)
    return [
        setting
        for cost in costs
        for setting in (
            *(Setting(cost, chosen) for chosen in itertools.product(factors, repeat=len(GROUPS))),
            *(Setting(cost, plain, bounds) for bounds in BOUND_FACTORS),
        )
    ]


def apply(config: LabConfig, setting: Setting, observables: Dictionary) -> LabConfig:
    """Return the configuration with the weights and bounds of a setting."""
    controller = config.controller.model_copy(update={"cost": setting.cost})
    names, q, r = stage_weights(controller, robot_type(config.robot.kind), observables)
    by_group = dict(zip(GROUPS, setting.factors, strict=True))
    scaled = Weights.model_validate(
        {
            "q": [by_group.get(group_of(n), 1.0) * w for n, w in zip(names, q, strict=True)],
            "r": [by_group["inputs"] * w for w in r],
        }
    )
    chosen = {
        "cost": setting.cost,
        "weights": {**controller.weights, setting.cost: scaled},
        "u_max": tuple(setting.bounds * u for u in controller.u_max),
    }
    return changed(config, "controller", **chosen)


def group_of(name: str) -> str:
    """Return the group of a state or an observable by its name; empty for none of them."""
    if name in ("x1", "x2"):
        return name
    speeds = {"v", "omega"} & set(name.replace("*", " ").replace("^", " ").split())
    return "angle" if "theta" in name and not speeds else ""


def study(
    config: LabConfig,
    prediction: PredictionModel,
    x0: NDArray[np.float64],
    duration_s: float,
    grid: Sequence[Setting],
) -> Iterator[WeightsRow]:
    """Simulate one setting after the other; see :func:`~.closed_loop.closed_loop`."""
    configured = dictionary(config.model.dictionary, config.robot.kind)
    for setting in grid:
        lab = apply(config, setting, prediction.dictionary or configured)
        run = closed_loop(lab, prediction, x0, duration_s)
        x1, x2, theta = run.states[-1, :3].tolist()
        yield WeightsRow(setting, (x1, x2, theta), x2_last_mm(run), run.unsolved)


def as_table(rows: Sequence[WeightsRow]) -> tuple[list[str], list[list[Any]]]:
    """Return column names and one line a row."""
    columns = ["cost", *(f"factor_{group}" for group in GROUPS), "factor_bounds"]
    columns += ["x1_m", "x2_m", "theta_rad", "x2_last_mm", "unsolved"]
    lines = [
        [r.setting.cost, *r.setting.factors, r.setting.bounds, *r.final, r.x2_last_mm, r.unsolved]
        for r in rows
    ]
    return columns, lines


def summary(rows: Sequence[WeightsRow]) -> dict[str, dict[str, float]]:
    """Return by cost what ``x2_last_mm`` is over the grid, and with the configured weights."""
    summaries: dict[str, dict[str, float]] = {}
    for cost in dict.fromkeys(row.setting.cost for row in rows):
        cost_rows = [row for row in rows if row.setting.cost == cost]
        final_mm = np.array([row.x2_last_mm for row in cost_rows])
        plain = next(
            row.x2_last_mm
            for row in cost_rows
            if set(row.setting.factors) == {1.0} and row.setting.bounds == 1.0
        )
        summaries[cost] = {
            "runs": len(cost_rows),
            "configured_mm": plain,
            "best_mm": float(final_mm.min()),
            "median_mm": float(np.median(final_mm)),
            "worst_mm": float(final_mm.max()),
            "share_below_1_mm": float(np.mean(final_mm < 1.0)),
            "share_below_5_mm": float(np.mean(final_mm < 5.0)),
        }
    return summaries

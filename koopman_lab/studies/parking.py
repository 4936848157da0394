"""Parking from random poses with every controller of the paper (sections 4 and 5.4).

A run is a function of its case and its number alone: the start is drawn from the seed and the
number, so that all controllers meet the same starts, in whatever order and process they run.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from koopman_lab.config.schema import CostName, LabConfig
from koopman_lab.koopman.model import BilinearModel
from koopman_lab.mpc.prediction import KoopmanPrediction, NominalPrediction, PredictionModel
from koopman_lab.mpc.receding_horizon import solver_of
from koopman_lab.mpc.solver import Solver
from koopman_lab.studies.closed_loop import closed_loop

Way = Literal["nominal", "reprojected", "lifted"]

KINEMATIC_STARTS = ((-1.0, 1.0), (-1.0, 1.0), (-math.pi, math.pi))
"""Section 4 of the paper; those of the second-order robot are X0 (section 5.1)."""
CONTROLLERS: tuple[tuple[CostName, Way], ...] = (
    *(("me", "reprojected"), ("me", "lifted"), ("ce", "reprojected"), ("ce", "lifted")),
    *(("ds", "reprojected"), ("ds", "lifted"), ("me", "nominal")),
)
"""What the paper compares; ``nominal`` predicts with the robot's equations."""
COLUMNS = (
    *("case", "index", "start_x1_m", "start_x2_m", "start_theta_rad"),
    *("x1_m", "x2_m", "theta_rad", "unsolved", "reason"),
)


@dataclass(frozen=True)
class Case:
    """A controller under a label: its configuration, and what it predicts with."""

    label: str
    config: LabConfig
    way: Way
    model: Path
    duration_s: float


def cases(config: LabConfig, model: Path, duration_s: float) -> list[Case]:
    """Return a case for each of :data:`CONTROLLERS`."""
    return [
        Case(f"{cost}-{way}", _configured(config, cost, way), way, model, duration_s)
        for cost, way in CONTROLLERS
    ]


def start(config: LabConfig, index: int) -> NDArray[np.float64]:
    """Return the state (n,) that run ``index`` begins in: a random pose, at rest."""
    drawn = config.sampler.draw_set
    dynamic = config.robot.kind == "dynamic"
    ranges = (drawn.x1_m, drawn.x2_m, drawn.theta_rad) if dynamic else KINEMATIC_STARTS
    low, high = np.array(ranges).T
    # The child that `spawn` of the seed would give as number `index`.
    rng = np.random.default_rng(np.random.SeedSequence(config.seed, spawn_key=(index,)))
    return np.concatenate([rng.uniform(low, high), np.zeros(2 if dynamic else 0)])


def run(case: Case, index: int) -> dict[str, Any]:
    """Return the row of one run, with :data:`COLUMNS` as keys; a failure is its ``reason``."""
    x0 = start(case.config, index)
    row = dict.fromkeys(COLUMNS) | {"case": case.label, "index": index}
    row |= zip(COLUMNS[2:5], x0[:3].tolist(), strict=True)
    try:
        prediction, solver = _made(case)
        done = closed_loop(case.config, prediction, x0, case.duration_s, solver)
    except Exception as error:  # whatever went wrong belongs into the table
        return row | {"reason": f"{type(error).__name__}: {error}"}
    if not np.isfinite(done.states).all():
        return row | {"unsolved": done.unsolved, "reason": "the state grew without bound"}
    row |= zip(COLUMNS[5:8], done.states[-1, :3].tolist(), strict=True)
    return row | {"unsolved": done.unsolved}


_MADE: dict[str, tuple[PredictionModel, Solver]] = {}


def _made(case: Case) -> tuple[PredictionModel, Solver]:
    """Return prediction and solver, made once in a process."""
    key = f"{case.way} {case.model} {case.config.model_dump_json()}"
    if key not in _MADE:
        prediction: PredictionModel = (
            NominalPrediction(case.config.robot.kind, case.config.controller.dt_s)
            if case.way == "nominal"
            else KoopmanPrediction(BilinearModel.load(case.model))
        )
        _MADE[key] = prediction, solver_of(prediction, case.config)
    return _MADE[key]


def _configured(config: LabConfig, cost: CostName, way: Way) -> LabConfig:
    chosen = {"cost": cost, "reprojection": way != "lifted"}
    return config.model_copy(update={"controller": config.controller.model_copy(update=chosen)})

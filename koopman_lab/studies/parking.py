"""Parking from random poses with every controller of the paper (sections 4 and 5.4).

A run is a function of its case and its number alone: the start is drawn from the seed and the
number, so that all controllers meet the same starts, in whatever order and process they run.
"""

from __future__ import annotations

import hashlib
import tempfile
import threading
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from koopman_lab.config.controller import CostName
from koopman_lab.config.schema import LabConfig
from koopman_lab.mpc.receding_horizon import solver_of
from koopman_lab.mpc.solver import Plan, Solver
from koopman_lab.predictors.nominal import NominalPrediction
from koopman_lab.predictors.predictor import LearnedModel, PredictionModel
from koopman_lab.predictors.table import load_model, prediction
from koopman_lab.robots.standard_runs import Box
from koopman_lab.robots.table import robot_type
from koopman_lab.studies.closed_loop import closed_loop

Way = Literal["nominal", "reprojected", "lifted"]

CONTROLLERS: tuple[tuple[CostName, Way], ...] = (
    *(("me", "reprojected"), ("me", "lifted"), ("ce", "reprojected"), ("ce", "lifted")),
    *(("ds", "reprojected"), ("ds", "lifted"), ("me", "nominal")),
)
"""What the paper compares; ``nominal`` predicts with the robot's equations."""
COLUMNS = (
    *("case", "index", "start_x1_m", "start_x2_m", "start_theta_rad"),
    *("x1_m", "x2_m", "theta_rad", "unsolved", "reason"),
)


TIMES = ("run_s", "solving_s")
"""What a row holds besides: real time of the run, and of the solver in it."""


@dataclass(frozen=True)
class Case:
    """A controller under a label, and all that another process or machine needs to run it.

    Attributes
    ----------
    label
        Names it within a study.
    config
        The lab; of it the robot's kind, the seed and the controller matter.
    way
        What it predicts with.
    duration_s
        Length of a run (s).
    model
        What the model's file holds; empty for ``nominal``.
    refused
        Why there is no model, for the rows of its runs.
    """

    label: str
    config: LabConfig
    way: Way
    duration_s: float
    model: bytes = b""
    refused: str = ""


def cases(config: LabConfig, model: bytes, duration_s: float) -> list[Case]:
    """Return a case for each of :data:`CONTROLLERS`."""
    return [
        Case(f"{cost}-{way}", _configured(config, cost, way), way, duration_s, model)
        for cost, way in CONTROLLERS
    ]


def start_box(config: LabConfig) -> Box:
    """Return the ranges of random starts: those of the robot's kind, or X0 (section 5.1)."""
    drawn = config.sampler.draw_set
    box = robot_type(config.robot.kind).runs.random_starts
    return box or (drawn.x1_m, drawn.x2_m, drawn.theta_rad)


def start(config: LabConfig, index: int) -> NDArray[np.float64]:
    """Return the state (n,) that run ``index`` begins in: a random pose, at rest."""
    low, high = np.array(start_box(config)).T
    # The child that `spawn` of the seed would give as number `index`.
    rng = np.random.default_rng(np.random.SeedSequence(config.seed, spawn_key=(index,)))
    return robot_type(config.robot.kind).state(rng.uniform(low, high))


def run(case: Case, index: int) -> dict[str, Any]:
    """Return the row of one run, with :data:`COLUMNS` as keys; a failure is its ``reason``.

    Besides it has :data:`TIMES`, which no two runs share.
    """
    x0 = start(case.config, index)
    row = dict.fromkeys(COLUMNS) | {"case": case.label, "index": index} | dict.fromkeys(TIMES, 0.0)
    row |= zip(COLUMNS[2:5], x0[:3].tolist(), strict=True)
    if case.refused:
        return row | {"reason": case.refused}
    try:
        prediction, solver = prediction_and_solver(case)
        began_s, solver.spent_s = time.perf_counter(), 0.0
        result = closed_loop(case.config, prediction, x0, case.duration_s, solver)
    except Exception as error:  # whatever went wrong belongs into the table
        return row | {"reason": f"{type(error).__name__}: {error}"}
    row |= zip(TIMES, (time.perf_counter() - began_s, solver.spent_s), strict=True)
    if not np.isfinite(result.states).all():
        return row | {"unsolved": result.unsolved, "reason": "the state grew without bound"}
    row |= zip(COLUMNS[5:8], result.states[-1, :3].tolist(), strict=True)
    return row | {"unsolved": result.unsolved}


class TimedSolver:
    """A solver that adds up the real time it takes.

    Parameters
    ----------
    solver
        The solver whose time is measured.
    """

    def __init__(self, solver: Solver) -> None:
        self._solver = solver
        self.rollout = solver.rollout
        self.description = solver.description
        self.spent_s = 0.0

    def solve(self, x0: NDArray[np.float64], guess: NDArray[np.float64]) -> Plan:
        """Return a plan; see :class:`~koopman_lab.mpc.solver.Solver`."""
        began_s = time.perf_counter()
        plan = self._solver.solve(x0, guess)
        self.spent_s += time.perf_counter() - began_s
        return plan

    def disturb(self, d: NDArray[np.float64]) -> None:
        """Plan with other last parameters; see :class:`~koopman_lab.mpc.solver.Solver`."""
        self._solver.disturb(d)


# Of each thread: a solver serves one, and a worker of a cluster may have several.
_PER_THREAD = threading.local()


def prediction_and_solver(case: Case) -> tuple[PredictionModel, TimedSolver]:
    """Return prediction and solver, made once in a process and thread.

    Raises
    ------
    LabError
        If model and configuration do not fit.
    """
    known: dict[str, tuple[PredictionModel, TimedSolver]] = _PER_THREAD.__dict__.setdefault(
        "known", {}
    )
    content = hashlib.sha256(case.model).hexdigest()
    key = f"{case.way} {content} {case.config.model_dump_json()}"
    if key not in known:
        planned: PredictionModel = (
            NominalPrediction(case.config.robot.kind, case.config.controller.dt_s)
            if case.way == "nominal"
            else prediction(_loaded(case.model, content))
        )
        known[key] = planned, TimedSolver(solver_of(planned, case.config))
    return known[key]


def _loaded(content: bytes, digest: str) -> LearnedModel:
    """Return the model of a file that holds this, read once however many cases are of it."""
    models: dict[str, LearnedModel] = _PER_THREAD.__dict__.setdefault("models", {})
    if digest not in models:
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / "model.npz"
            file.write_bytes(content)
            models[digest] = load_model(file)
    return models[digest]


def _configured(config: LabConfig, cost: CostName, way: Way) -> LabConfig:
    return with_controller(config, cost=cost, reprojection=way != "lifted")


def with_controller(config: LabConfig, **chosen: Any) -> LabConfig:
    """Return the lab with other settings of the controller."""
    return config.model_copy(update={"controller": config.controller.model_copy(update=chosen)})

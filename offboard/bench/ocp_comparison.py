"""`klab bench ocp`: our solver beside CasADi with IPOPT and do-mpc.

All solve the same problems, recorded in a closed loop, from the same initial guesses, and all plans
are valued by the same simulation.
"""

from __future__ import annotations

import contextlib
import tempfile
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from koopman_lab.config.change import changed
from koopman_lab.config.schema import LabConfig
from koopman_lab.koopman.bilinear_model import BilinearModel
from koopman_lab.mpc.configured_cost import stage_cost
from koopman_lab.mpc.receding_horizon import RecedingHorizon, solver_of
from koopman_lab.mpc.rollout import Rollout
from koopman_lab.mpc.solver import Plan, Solver
from koopman_lab.mpc.stage_costs import StageCost
from koopman_lab.predictors.bilinear_edmd import KoopmanPrediction
from koopman_lab.predictors.lifted import LiftedPrediction
from koopman_lab.predictors.predictor import PredictionModel
from koopman_lab.robots.table import ROBOTS, robot_type
from offboard.bench.ocp_solvers import Candidate, Task, lab_solver, makers
from offboard.terminal import options

Array = NDArray[np.float64]

NOTICEABLE = 1e-6
"""A plan that costs this share more than another counts as worse."""
WARM_UP = 5
"""Calls before the clock counts, to fill caches."""
WAYS = ("reprojected", "lifted")
QUICK = 30
POLISHING = 500
"""Iterations, to tell a local minimum from an early stop."""


@dataclass(frozen=True)
class Row:
    """One solver on one problem.

    Attributes
    ----------
    problem, model, solver
        Name of the robot's type; reprojected or lifted; ours, ipopt or do-mpc.
    states
        Number of problems in the sequence.
    build_s
        Time to make the solver; ours with a library already in the cache.
    median_ms, p99_ms, max_ms
        Of a call, from a state and a guess to inputs.
    cpu_median_ms, cpu_p99_ms
        The same by the CPU time of this process, which a busy machine lengthens less.
    iterations_median, iterations_max
        Of a call.
    worse_share
        Share of the states where another solver's plan costs noticeably less.
    largest_excess
        Largest share by which the plan costs more than the best of the others; negative if never.
    exceptions
        Where it is worse: index of the state; own value; best value of the others; whether more
        effort leads from the own plan to a noticeably better one, so that the solver stopped early
        and otherwise in another local minimum; and the value where our solver ends from the best
        of the others' plans, which tells whether that is a minimum to ours as well.
    """

    problem: str
    model: str
    solver: str
    states: int
    build_s: float
    median_ms: float
    p99_ms: float
    max_ms: float
    cpu_median_ms: float
    cpu_p99_ms: float
    iterations_median: float
    iterations_max: int
    worse_share: float
    largest_excess: float
    exceptions: list[dict[str, Any]]


@contextlib.contextmanager
def trained(files: Sequence[Path] | None) -> Iterator[list[BilinearModel]]:
    """Give the models in files, or one of each robot, trained from sessions recorded for this."""
    if files:
        yield [BilinearModel.load(file) for file in files]
        return
    from koopman_lab.data.dataset import DataSet
    from koopman_lab.data.decode import SessionLog
    from koopman_lab.koopman.trainer import train
    from offboard.lab.calibration import calibrate
    from offboard.lab.run_folder import new_folder

    models = []
    with tempfile.TemporaryDirectory(prefix="koopman-lab-") as place:
        for robot in ROBOTS:
            if robot.drive is None:
                continue  # nothing here could record its session
            segments = f"sampler.segments_per_basis={robot.runs.bench_segments}"
            lab = options.resolve(None, [segments], robot.name)
            folder = new_folder(Path(place) / robot.name, "bench", lab)
            calibrate(lab, folder, None)
            data = DataSet.from_log(SessionLog(folder.log))
            models.append(train(data, lab.model.dictionary)[0])
        yield models


class _Recorder:
    """Hands every problem on to a solver and keeps it."""

    def __init__(self, solver: Solver) -> None:
        self.description, self.rollout = solver.description, solver.rollout
        self._solver = solver
        self.asked: list[tuple[Task, Plan]] = []

    def disturb(self, d: Array) -> None:
        self._solver.disturb(d)

    def solve(self, x0: Array, guess: Array) -> Plan:
        plan = self._solver.solve(x0, guess)
        self.asked.append((Task(x0.copy(), guess.copy()), plan))
        return plan


def record(config: LabConfig, model: PredictionModel, count: int) -> list[Task]:
    """Return the problems of a closed loop on the nominal equations, each with its shifted plan.

    Of the first step's guesses the one counts that led to the best plan.
    """
    solver, settings = solver_of(model, config), config.controller
    recorder = _Recorder(solver)
    optimiser = RecedingHorizon(recorder, solver.rollout, settings.u_max, settings.dt_s)
    robot = robot_type(config.robot.kind)
    x = robot.state(robot.runs.simulate_start)
    tasks = []
    for _ in range(count):
        recorder.asked.clear()
        decision = optimiser.step(x)
        tasks.append(min(recorder.asked, key=lambda asked: asked[1].value)[0])
        x = robot.step(x, decision.u, config.controller.dt_s)
    return tasks


def compare(config: LabConfig, model: BilinearModel, count: int) -> Iterator[Row]:
    """Give a row for each solver, with and without reprojection.

    Parameters
    ----------
    config
        The lab; its cost, horizon and bounds make the problem.
    model
        Of the same robot.
    count
        Number of states.
    """
    for name in WAYS:
        lab = changed(config, "controller", reprojection=name == "reprojected")
        tasks = record(lab, KoopmanPrediction(model), count)
        prediction = KoopmanPrediction(model) if name == "reprojected" else LiftedPrediction(model)
        cost = stage_cost(lab.controller, model.robot, model.dictionary)
        timed = _time(lab, prediction, cost, tasks)
        yield from _rows(lab, prediction, cost, name, tasks, timed)


def rows_of(models: Sequence[BilinearModel]) -> int:
    """Return how many rows there will be."""
    return len(models) * len(WAYS) * len(makers())


@dataclass
class _Timed:
    """What one solver did, a number for each state."""

    candidate: Candidate
    build_s: float
    wall_ms: list[float] = field(default_factory=list)
    cpu_ms: list[float] = field(default_factory=list)
    iterations: list[int] = field(default_factory=list)
    values: list[float] = field(default_factory=list)
    plans: list[Array] = field(default_factory=list)


def _time(
    lab: LabConfig, prediction: PredictionModel, cost: StageCost, tasks: Sequence[Task]
) -> dict[str, _Timed]:
    """Give every state to one solver after the other, so that a busy machine hinders all alike."""
    rollout = Rollout(prediction, cost, lab.controller.horizon)
    bound = np.array(lab.controller.u_max)
    timed = {}
    for name, make in makers().items():
        make(lab, prediction, cost)
        began = time.perf_counter()
        candidate = make(lab, prediction, cost)
        timed[name] = _Timed(candidate, time.perf_counter() - began)
        for task in tasks[:WARM_UP]:
            candidate.prepare(task)
            candidate.run()
    for task in tasks:
        for entry in timed.values():
            entry.candidate.prepare(task)
            began, cpu_began = time.perf_counter(), time.process_time()
            entry.candidate.run()
            entry.wall_ms.append(1e3 * (time.perf_counter() - began))
            entry.cpu_ms.append(1e3 * (time.process_time() - cpu_began))
            inputs, count = entry.candidate.answer()
            entry.iterations.append(count)
            entry.plans.append(np.clip(inputs, -bound, bound))
            entry.values.append(rollout(task.x0, entry.plans[-1])[1])
    return timed


def _rows(
    lab: LabConfig,
    prediction: PredictionModel,
    cost: StageCost,
    name: str,
    tasks: Sequence[Task],
    timed: dict[str, _Timed],
) -> list[Row]:
    rows = []
    polish = lab_solver(lab, prediction, cost, most_iterations=POLISHING)
    for solver, entry in timed.items():
        others = [other for key, other in timed.items() if key != solver]
        best = np.min([other.values for other in others], axis=0)
        excess = np.array(entry.values) / best - 1.0
        exceptions = []
        for index in np.flatnonzero(excess > NOTICEABLE).tolist():
            x0, winner = tasks[index].x0, min(others, key=lambda other: other.values[index])
            polished = polish.solve(x0, entry.plans[index]).value
            exceptions.append(
                {
                    "state": index,
                    "value": float(entry.values[index]),
                    "best": float(best[index]),
                    "stopped_early": bool(polished < entry.values[index] * (1.0 - NOTICEABLE)),
                    "ours_from_best": polish.solve(x0, winner.plans[index]).value,
                }
            )
        median, p99, largest = np.percentile(entry.wall_ms, [50.0, 99.0, 100.0]).tolist()
        rows.append(
            Row(
                lab.robot.kind,
                name,
                solver,
                len(tasks),
                entry.build_s,
                median,
                p99,
                largest,
                float(np.median(entry.cpu_ms)),
                float(np.percentile(entry.cpu_ms, 99.0)),
                float(np.median(entry.iterations)),
                max(entry.iterations),
                len(exceptions) / len(tasks),
                float(excess.max()),
                exceptions,
            )
        )
    return rows

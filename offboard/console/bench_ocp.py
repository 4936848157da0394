"""Our solver beside what a Python user has: CasADi with IPOPT, and do-mpc.

All solve the same problems, recorded in a closed loop, from the same initial guesses, and all plans
are valued by the same simulation.
"""

from __future__ import annotations

import contextlib
import importlib.util
import tempfile
import time
import warnings
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

from koopman_lab.config.schema import BackEnd, LabConfig, RobotKind
from koopman_lab.koopman.model import BilinearModel
from koopman_lab.mpc.costs import StageCost, stage_cost
from koopman_lab.mpc.prediction import KoopmanPrediction, LiftedPrediction, PredictionModel
from koopman_lab.mpc.receding_horizon import RecedingHorizon, solver_of
from koopman_lab.mpc.rollout import Rollout
from koopman_lab.mpc.solver import Plan, Solver, make_solver
from koopman_lab.robot.models import nominal_model
from offboard.console import options

if TYPE_CHECKING:
    from rich.table import Table

Array = NDArray[np.float64]

STARTS = {"kinematic": (-1.0, -0.5, -np.pi / 6.0), "dynamic": (1.0, 0.2, np.pi / 4.0, 0.0, 0.0)}
"""The paper's simulations, sections 4 and 5.4."""
NOTICEABLE = 1e-6
"""A plan that costs this share more than another counts as worse."""
WARM_UP = 5
"""Calls before the clock counts, to fill caches."""
WAYS = ("reprojected", "lifted")
DO_MPC = "do_mpc"
QUICK = 30
POLISHING = 500
"""Iterations, to tell a local minimum from an early stop."""
SESSIONS: dict[RobotKind, list[str]] = {
    "kinematic": [],
    "dynamic": ["sampler.segments_per_basis=15"],
}
"""How models are had when none is named."""
IPOPT_ITERATIONS = 3000
"""IPOPT's own default."""


@dataclass(frozen=True)
class Task:
    """One problem of the sequence."""

    x0: Array
    guess: Array


@dataclass(frozen=True)
class Row:
    """One solver on one problem.

    Attributes
    ----------
    problem, model, solver
        kinematic or dynamic; reprojected or lifted; ours, ipopt or do-mpc.
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
        Where it is worse: index of the state, own value, best value of the others, and whether
        going downhill from the own plan leads to a noticeably better one: then the solver stopped
        early, and otherwise in another local minimum.
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


class Candidate(Protocol):
    """A solver under the clock; only ``run`` is timed."""

    def prepare(self, task: Task) -> None:
        """Take the problem."""

    def run(self) -> None:
        """Solve it."""

    def answer(self) -> tuple[Array, int]:
        """Return the inputs (H, 2) of the plan, and the number of iterations."""


def has_do_mpc() -> bool:
    """Return whether do-mpc is installed."""
    return importlib.util.find_spec(DO_MPC) is not None


@contextlib.contextmanager
def trained(files: Sequence[Path] | None) -> Iterator[list[BilinearModel]]:
    """Give the models in files, or one of each robot, trained from sessions recorded for this."""
    if files:
        yield [BilinearModel.load(file) for file in files]
        return
    from koopman_lab.data.dataset import DataSet
    from koopman_lab.data.decode import SessionLog
    from koopman_lab.koopman.train import train
    from offboard.console.calibrate import record as calibrate
    from offboard.console.folder import new_folder

    models = []
    with tempfile.TemporaryDirectory(prefix="koopman-lab-") as place:
        for kind, overrides in SESSIONS.items():
            lab = options.resolve(None, overrides, kind)
            folder = new_folder(Path(place) / kind, "bench", lab)
            calibrate(lab, folder, None)
            data = DataSet.from_log(SessionLog(folder.log))
            models.append(train(data, lab.model.dictionary)[0])
        yield models


Maker = Callable[[LabConfig, PredictionModel, StageCost], Candidate]


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
    robot, x = nominal_model(config.robot.kind), np.array(STARTS[config.robot.kind])
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
        chosen = {"reprojection": name == "reprojected"}
        lab = config.model_copy(update={"controller": config.controller.model_copy(update=chosen)})
        tasks = record(lab, KoopmanPrediction(model), count)
        prediction = KoopmanPrediction(model) if name == "reprojected" else LiftedPrediction(model)
        cost = stage_cost(lab.controller, model.dictionary)
        timed = _time(lab, prediction, cost, tasks)
        yield from _rows(lab, prediction, cost, name, tasks, timed)


def rows_of(models: Sequence[BilinearModel]) -> int:
    """Return how many rows there will be."""
    return len(models) * len(WAYS) * len(_makers())


def _makers() -> dict[str, Maker]:
    makers: dict[str, Maker] = {"ours": _ours, "ipopt": _ipopt}
    return makers | ({"do-mpc": _DoMpc} if has_do_mpc() else {})


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
    for name, make in _makers().items():
        make(lab, prediction, cost)
        began = time.perf_counter()
        candidate = make(lab, prediction, cost)
        timed[name] = _Timed(candidate, time.perf_counter() - began)
        for task in tasks[:WARM_UP]:
            candidate.prepare(task)
            candidate.run()
    for task in tasks:
        for found in timed.values():
            found.candidate.prepare(task)
            began, cpu_began = time.perf_counter(), time.process_time()
            found.candidate.run()
            found.wall_ms.append(1e3 * (time.perf_counter() - began))
            found.cpu_ms.append(1e3 * (time.process_time() - cpu_began))
            inputs, count = found.candidate.answer()
            found.iterations.append(count)
            found.plans.append(np.clip(inputs, -bound, bound))
            found.values.append(rollout(task.x0, found.plans[-1])[1])
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
    polish = _solver(lab, prediction, cost, most_iterations=POLISHING)
    for solver, found in timed.items():
        best = np.min([other.values for key, other in timed.items() if key != solver], axis=0)
        excess = np.array(found.values) / best - 1.0
        exceptions = []
        for index in np.flatnonzero(excess > NOTICEABLE).tolist():
            polished = polish.solve(tasks[index].x0, found.plans[index]).value
            exceptions.append(
                {
                    "state": index,
                    "value": float(found.values[index]),
                    "best": float(best[index]),
                    "stopped_early": bool(polished < found.values[index] * (1.0 - NOTICEABLE)),
                }
            )
        median, p99, largest = np.percentile(found.wall_ms, [50.0, 99.0, 100.0]).tolist()
        rows.append(
            Row(
                lab.robot.kind,
                name,
                solver,
                len(tasks),
                found.build_s,
                median,
                p99,
                largest,
                float(np.median(found.cpu_ms)),
                float(np.percentile(found.cpu_ms, 99.0)),
                float(np.median(found.iterations)),
                max(found.iterations),
                len(exceptions) / len(tasks),
                float(excess.max()),
                exceptions,
            )
        )
    return rows


def _solver(
    lab: LabConfig,
    prediction: PredictionModel,
    cost: StageCost,
    back_end: BackEnd | None = None,
    most_iterations: int | None = None,
    *,
    scaled: bool = True,
) -> Solver:
    settings = lab.controller
    return make_solver(
        prediction,
        cost,
        settings.horizon,
        settings.u_max,
        back_end or settings.solver,
        most_iterations,
        use_compiler=settings.use_compiler,
        scaled=scaled,
    )


class _Own:
    """A solver behind our interface."""

    def __init__(self, solver: Solver) -> None:
        self._solver = solver

    def prepare(self, task: Task) -> None:
        self._task = task

    def run(self) -> None:
        self._plan = self._solver.solve(self._task.x0, self._task.guess)

    def answer(self) -> tuple[Array, int]:
        return self._plan.inputs, self._plan.iterations


def _ours(lab: LabConfig, prediction: PredictionModel, cost: StageCost) -> Candidate:
    return _Own(_solver(lab, prediction, cost))


def _ipopt(lab: LabConfig, prediction: PredictionModel, cost: StageCost) -> Candidate:
    """Return the paper's solver: unrolled, default options, the objective as it is."""
    return _Own(_solver(lab, prediction, cost, "ipopt", IPOPT_ITERATIONS, scaled=False))


class _DoMpc:
    """do-mpc as its documentation shows it; the guess is written into its vector of variables."""

    def __init__(self, lab: LabConfig, prediction: PredictionModel, cost: StageCost) -> None:
        with warnings.catch_warnings():
            # do-mpc warns of optional parts that are not installed, CasADi of do-mpc's calls.
            warnings.simplefilter("ignore")
            self._mpc = self._made(lab, prediction, cost)
        self._horizon = lab.controller.horizon
        self._rollout = Rollout(prediction, cost, self._horizon)

    @staticmethod
    def _made(lab: LabConfig, prediction: PredictionModel, cost: StageCost) -> Any:
        import casadi as ca
        import do_mpc

        settings, rest = lab.controller, ca.SX.zeros(2)
        numbers, weights = ca.DM(prediction.parameters), ca.DM(cost.parameters)
        model = do_mpc.model.Model("discrete", "SX")
        s = model.set_variable("_x", "s", shape=(prediction.size, 1))
        u = model.set_variable("_u", "u", shape=(2, 1))
        model.set_rhs("s", prediction.step(s, u, numbers))
        model.setup()
        s, u = model.x["s"], model.u["u"]
        mpc = do_mpc.controller.MPC(model)
        mpc.settings.n_horizon = settings.horizon
        mpc.settings.t_step = settings.dt_s
        mpc.settings.store_full_solution = False
        mpc.settings.supress_ipopt_output()
        stage, end = (prediction.cost(cost, s, v, weights) for v in (u, rest))
        mpc.set_objective(lterm=stage, mterm=end)
        mpc.set_rterm(u=0.0)
        mpc.bounds["lower", "_u", "u"] = -np.array(settings.u_max)
        mpc.bounds["upper", "_u", "u"] = np.array(settings.u_max)
        mpc.setup()
        mpc.set_initial_guess()
        return mpc

    def prepare(self, task: Task) -> None:
        propagated = self._rollout.trajectory(task.x0, task.guess).propagated
        variables = self._mpc.opt_x_num
        for k, s in enumerate(propagated):
            variables["_x", k, 0, -1] = s
        for k, u in enumerate(task.guess):
            variables["_u", k, 0] = u
        self._s0 = propagated[0].reshape(-1, 1)

    def run(self) -> None:
        self._mpc.make_step(self._s0)

    def answer(self) -> tuple[Array, int]:
        variables = self._mpc.opt_x_num
        inputs = [np.asarray(variables["_u", k, 0]).ravel() for k in range(self._horizon)]
        return np.array(inputs), int(self._mpc.solver_stats["iter_count"])


def as_table(rows: Sequence[Row]) -> Table:
    """Return the figures as a table."""
    from rich.table import Table

    table = Table(box=None, pad_edge=False, collapse_padding=True, title="one call, ms")
    for column in ("problem", "model", "solver"):
        table.add_column(column, no_wrap=True)
    for column in ("median", "p99", "max", "CPU", "CPU p99", "iter.", "worse", "build s"):
        table.add_column(column, justify="right")
    for row in rows:
        table.add_row(
            row.problem,
            row.model,
            row.solver,
            *(f"{ms:.2f}" for ms in (row.median_ms, row.p99_ms, row.max_ms)),
            *(f"{ms:.2f}" for ms in (row.cpu_median_ms, row.cpu_p99_ms)),
            f"{row.iterations_median:.0f}/{row.iterations_max}",
            f"{100.0 * row.worse_share:.1f} %",
            f"{row.build_s:.2f}",
        )
    return table


def remarks(rows: Sequence[Row]) -> list[str]:
    """Return what the figures say of our solver."""
    lines = []
    for row in rows:
        if row.solver != "ours":
            continue
        peers = [r for r in rows if (r.problem, r.model) == (row.problem, row.model)]
        factors = [
            f"{r.median_ms / row.median_ms:.1f} times as fast as {r.solver}"
            for r in peers
            if r.solver != "ours"
        ]
        lines.append(f"{row.problem}, {row.model}: ours is {', '.join(factors)}")
        lines += [
            f"  state {e['state']}: {e['value']:.6g} against {e['best']:.6g}, "
            + ("stopped early" if e["stopped_early"] else "another local minimum")
            for e in row.exceptions
        ]
    return lines

"""`klab bench parks`: from how many random starts each controller parks the robot of the lab."""

from __future__ import annotations

import json
import math
import tempfile
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from koopman_lab.config.change import changed
from koopman_lab.geometry.planar import Pose, relative_to
from offboard.terminal import options
from offboard.terminal.needs import needs
from offboard.terminal.output import err, out, progress

if TYPE_CHECKING:
    from rich.table import Table

    from koopman_lab.config.schema import LabConfig
    from koopman_lab.mpc.solver import Solver
    from koopman_lab.predictors.predictor import PredictionModel

LARGEST_X2_M, LARGEST_ANGLE_RAD = 0.005, math.radians(2.0)
"""What counts as within."""
AFTER_LIMIT_S = 3.0


@dataclass(frozen=True)
class Park:
    """How one run ended: whether the controller says so, and where the robot truly stands.

    ``pose`` relative to the goal in m, m, rad; ``duration_s`` of the drive; ``stopped`` is why the
    robot was stopped before the time limit, or never started, empty if it was not.
    """

    parked: bool
    pose: tuple[float, float, float]
    duration_s: float
    stopped: str = ""

    @property
    def within(self) -> bool:
        """Whether x2 and angle are as small as they should be."""
        return abs(self.pose[1]) <= LARGEST_X2_M and abs(self.pose[2]) <= LARGEST_ANGLE_RAD


@dataclass(frozen=True)
class Row:
    """What a controller did from all starts; medians and largest values of magnitudes.

    ``stopped`` counts the runs that were stopped, by reason.
    """

    controller: str
    runs: int
    parked_share: float
    within_share: float
    x1_median_mm: float
    x2_median_mm: float
    angle_median_deg: float
    x1_max_mm: float
    x2_max_mm: float
    angle_max_deg: float
    duration_median_s: float
    stopped: dict[str, int]


@needs("desk")
def parks(
    model: options.ModelFile,
    runs: Annotated[int, typer.Option("--runs", min=1, help="Number of starts.")] = 100,
    seed: options.Seed = None,
    config: options.ConfigFile = None,
    overrides: options.Overrides = None,
    preset: options.Preset = options.PresetName.lab,
    as_json: options.AsJson = False,
) -> None:
    """Park the robot of the lab from random starts, in lockstep, with several controllers.

    The model as it is, the model without a steady error, and the nominal equations meet the same
    starts and the same noise.

    Example: klab bench parks --model runs/model.npz --runs 100
    """
    from koopman_lab.predictors.nominal import NominalPrediction
    from koopman_lab.predictors.predictor import require_robot
    from koopman_lab.predictors.table import load_model, prediction

    loaded = load_model(model)
    kind = None if config else loaded.robot.name
    lab = options.resolve(config, overrides, kind, preset, seed)
    require_robot(loaded, lab.robot.kind)
    lab.require_simulation()
    offset_free = lab.controller.offset_free.model_copy(update={"enabled": True})
    corrected = changed(lab, "controller", offset_free=offset_free)
    koopman = prediction(loaded)
    nominal = NominalPrediction(lab.robot.kind, lab.controller.dt_s)
    controllers: dict[str, tuple[LabConfig, PredictionModel]] = {
        "koopman": (lab, koopman),
        "koopman, offset-free": (corrected, koopman),
        "nominal": (lab, nominal),
    }
    with progress("parking") as report:
        outcomes = park_all(
            controllers, starts(lab, runs), lambda done, total: report(done, total, "runs")
        )
    rows = [summarise(name, ends) for name, ends in outcomes.items()]
    if as_json:
        out.print_json(json.dumps([asdict(row) for row in rows]))
        return
    out.print(as_table(rows, lab.robot.kind))
    for row in rows:
        for reason, count in row.stopped.items():
            err.print(f"{row.controller}: {count} stopped: {reason}")
    err.print(
        f"within: |x2| <= {1e3 * LARGEST_X2_M:g} mm and |theta| <= "
        f"{math.degrees(LARGEST_ANGLE_RAD):g} deg of where the robot truly stands"
    )


def starts(config: LabConfig, count: int) -> list[Pose]:
    """Return random poses at rest, the same for the same seed."""
    import numpy as np

    from koopman_lab.studies.parking import start_box

    low, high = np.array(start_box(config)).T
    rng = np.random.default_rng([config.seed, count])
    return [Pose(*row) for row in rng.uniform(low, high, (count, 3)).tolist()]


def park_all(
    controllers: Mapping[str, tuple[LabConfig, PredictionModel]],
    begin: Sequence[Pose],
    on_progress: Callable[[int, int], None],
) -> dict[str, list[Park]]:
    """Return how each controller does from each start."""
    from koopman_lab.mpc.receding_horizon import solver_of

    ends: dict[str, list[Park]] = {name: [] for name in controllers}
    solvers = {name: solver_of(model, config) for name, (config, model) in controllers.items()}
    for number, start in enumerate(begin):
        for name, (config, prediction) in controllers.items():
            on_progress(sum(map(len, ends.values())), len(begin) * len(controllers))
            noise = config.model_copy(update={"seed": config.seed + number})
            ends[name].append(park_once(noise, prediction, start, solvers[name]))
    return ends


def park_once(
    config: LabConfig, prediction: PredictionModel, start: Pose, solver: Solver | None = None
) -> Park:
    """Run the whole lab on virtual time until the controller ends the drive.

    ``solver`` was made before for the same model and configuration; None to make it here.
    """
    from koopman_lab.bus.lockstep import Lockstep
    from offboard.bench.faults.stage import Witness
    from offboard.controller.controller_step import State
    from offboard.controller.node import ControllerNode
    from offboard.lab import nodes
    from offboard.logger.node import LoggerNode

    placed = changed(config, "simulation.plant", initial_pose=tuple(start))
    node = ControllerNode(placed, prediction, solver=solver)
    lab, witness = Lockstep(placed), Witness()
    with tempfile.TemporaryDirectory() as folder:
        log = LoggerNode(placed, Path(folder) / "session.lcm")
        nodes.add_robot(lab, placed)
        for node_or_witness in (log, node, witness):
            lab.add(node_or_witness)
        try:
            lab.run(config.controller.time_limit_s + AFTER_LIMIT_S)
        finally:
            lab.close()
    outcome, last = node.outcome(), witness.sights[-1]
    end = relative_to(outcome.goal, Pose(last.x1_m, last.x2_m, last.theta_rad))
    stopped = outcome.reason if outcome.state in (State.FAILED.name, State.WAIT.name) else ""
    return Park(outcome.parked, (end.x1, end.x2, end.theta), outcome.duration_s, stopped)


def summarise(controller: str, ends: Sequence[Park]) -> Row:
    """Return what the ends of several runs have in common."""
    import numpy as np

    sizes = np.abs([end.pose for end in ends]) * [1e3, 1e3, math.degrees(1.0)]
    medians, largest = np.median(sizes, axis=0).tolist(), sizes.max(axis=0).tolist()
    return Row(
        controller,
        len(ends),
        float(np.mean([end.parked for end in ends])),
        float(np.mean([end.within for end in ends])),
        *(medians[0], medians[1], medians[2]),
        *(largest[0], largest[1], largest[2]),
        float(np.median([end.duration_s for end in ends])),
        dict(Counter(end.stopped for end in ends if end.stopped)),
    )


def as_table(rows: Sequence[Row], kind: str) -> Table:
    """Return the rows for a person."""
    from rich.table import Table

    table = Table("controller", title=f"parks of the {kind} robot, {rows[0].runs} starts")
    for column in ("parked", "within", "|x1| mm", "|x2| mm", "|theta| deg", "after s"):
        table.add_column(column, justify="right")
    for row in rows:
        table.add_row(
            row.controller,
            f"{row.parked_share:.0%}",
            f"{row.within_share:.0%}",
            f"{row.x1_median_mm:.1f} ({row.x1_max_mm:.1f})",
            f"{row.x2_median_mm:.1f} ({row.x2_max_mm:.1f})",
            f"{row.angle_median_deg:.2f} ({row.angle_max_deg:.2f})",
            f"{row.duration_median_s:.1f}",
        )
    table.caption = "median (largest)"
    return table

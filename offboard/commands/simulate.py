"""`klab simulate`: the closed loop on the nominal equations, as in the paper's simulations."""

from __future__ import annotations

import math
from enum import Enum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from koopman_lab.config.change import changed
from koopman_lab.errors import ModelError
from koopman_lab.robots.table import robot_type
from offboard.lab.run_folder import RunFolder, new_folder
from offboard.terminal import options
from offboard.terminal.needs import needs
from offboard.terminal.output import err, out, progress

if TYPE_CHECKING:
    from koopman_lab.config.schema import LabConfig
    from koopman_lab.predictors.predictor import PredictionModel
    from koopman_lab.studies.closed_loop import Run


class Predict(str, Enum):
    """Choices of ``--predict``."""

    nominal = "nominal"
    reprojected = "reprojected"
    lifted = "lifted"


@needs("desk")
def simulate(
    model: Annotated[
        Path | None, typer.Option("--model", metavar="FILE", help="From `klab train`.")
    ] = None,
    start: options.Start = None,
    cost: options.Costs = None,
    predict: Annotated[
        list[Predict] | None,
        typer.Option(
            "--predict",
            help="What the controller predicts with: the nominal equations, or the model with or "
            "without reprojection; several may be named.",
        ),
    ] = None,
    duration_s: Annotated[
        float | None,
        typer.Option("--duration", metavar="S", min=0.1, help="Length of each run, s."),
    ] = None,
    config: options.ConfigFile = None,
    overrides: options.Overrides = None,
    robot: options.Robot = None,
    folder: options.Out = None,
) -> None:
    """Drive the nominal robot to the origin with one controller after the other, and draw them.

    Robot and sampling time are those of the model. DIR gets a trajectory for each controller, one
    figure of all, and summary.json. In simulation the second-order robot starts at rest.

    Example: klab simulate --model runs/model.npz --start 0 0.5 0 --cost me --cost ce --cost ds
    """
    from koopman_lab.predictors.table import load_model
    from koopman_lab.studies.closed_loop import closed_loop

    loaded = None if model is None else load_model(model)
    kind, changes = robot, list(overrides or ())
    if loaded is not None:
        kind = kind or (loaded.robot.name if config is None else None)
        changes.insert(0, f"controller.dt_s={loaded.dt_s}")
    costs = list(cost or ())
    prediction_names = [prediction_name.value for prediction_name in predict or ()] or [
        "nominal" if loaded is None else "reprojected"
    ]
    lab = options.resolve(config, changes, kind)
    costs = costs or [lab.controller.cost]
    description = robot_type(lab.robot.kind)
    x0 = description.state(options.start_or_default(start, description.runs.simulate_start))
    seconds = duration_s if duration_s is not None else description.runs.simulate_s
    controllers = [(c, prediction_name) for c in costs for prediction_name in prediction_names]
    labs = [
        changed(lab, "controller", cost=c, reprojection=prediction_name != "lifted")
        for c, prediction_name in controllers
    ]
    models = [_prediction(lab, loaded, prediction_name) for _, prediction_name in controllers]
    results_folder, runs = new_folder(folder, "simulation", lab), {}
    with progress("simulating") as report:
        for number, (c, prediction_name) in enumerate(controllers):
            runs[f"{c}-{prediction_name}"] = closed_loop(labs[number], models[number], x0, seconds)
            report(number + 1, len(controllers), f"{c}, {prediction_name}")
    _write_results(results_folder, lab, runs, model)


def _prediction(lab: LabConfig, loaded: Any, prediction_name: str) -> PredictionModel:
    from koopman_lab.predictors.nominal import NominalPrediction
    from koopman_lab.predictors.predictor import require_robot
    from koopman_lab.predictors.table import prediction

    if prediction_name == "nominal":
        return NominalPrediction(lab.robot.kind, lab.controller.dt_s)
    if loaded is None:
        raise ModelError(f"--predict {prediction_name} needs a model; name it with --model")
    require_robot(loaded, lab.robot.kind)
    return prediction(loaded)


def _write_results(
    results_folder: RunFolder, lab: LabConfig, runs: dict[str, Run], model: Path | None
) -> None:
    from rich.table import Table

    from koopman_lab.figures.path_figure import Curve, draw_paths
    from koopman_lab.files import write_csv
    from koopman_lab.robots.table import robot_type
    from koopman_lab.studies import closed_loop

    table = Table(box=None, pad_edge=False, title="where the robot is at the end")
    table.add_column("controller", no_wrap=True)
    columns = ("x1 (mm)", "|x2| (mm)", "last s (mm)", "theta (deg)", "value", "iter.", "unsolved")
    for column in columns:
        table.add_column(column, justify="right")
    facts, curves, robot = {}, [], robot_type(lab.robot.kind)
    for name, run in runs.items():
        write_csv(
            results_folder.path / f"{name}.csv",
            closed_loop.columns(robot),
            closed_loop.as_rows(run, robot),
        )
        curves.append(Curve(name, run.time_s[:-1], run.states[:-1, :3], run.values))
        x1, x2, theta = run.states[-1, :3].tolist()
        facts[name] = {
            "final_state": run.states[-1].tolist(),
            "x2_mm": 1e3 * abs(x2),
            "x2_mm_last_second": closed_loop.x2_last_mm(run),
            "value": float(run.values[-1]),
            "iterations_mean": float(run.iterations.mean()),
            "unsolved": run.unsolved,
        }
        table.add_row(
            name,
            f"{1e3 * x1:.3f}",
            f"{1e3 * abs(x2):.4f}",
            f"{closed_loop.x2_last_mm(run):.4f}",
            f"{math.degrees(theta):.3f}",
            f"{run.values[-1]:.2e}",
            f"{run.iterations.mean():.1f}",
            str(run.unsolved),
        )
    first = next(iter(runs.values()))
    results_folder.write_summary(
        lab,
        {
            "what": "simulation",
            "model": None if model is None else str(model),
            "start": first.states[0].tolist(),
            "duration_s": float(first.time_s[-1]),
            "controllers": facts,
        },
    )
    out.print(table)
    draw_paths(results_folder.path / "paths", curves)
    err.print(f"figure: {results_folder.path / 'paths.png'}")

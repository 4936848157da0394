"""`klab park`: drive the robot to a goal pose with a trained model."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import typer

from koopman_lab.robots.table import robot_type
from offboard.lab.run_folder import RunFolder, new_folder
from offboard.terminal import options
from offboard.terminal.exit_codes import ExitCode
from offboard.terminal.needs import needs
from offboard.terminal.output import err, print_summary, show_verdicts

if TYPE_CHECKING:
    from offboard.desk.results import ParkSummary


@needs("desk")
def park(
    model: options.ModelFile,
    start: options.Start = None,
    goal: options.Goal = (0.0, 0.0, 0.0),
    cost: options.Cost = None,
    config: options.ConfigFile = None,
    overrides: options.Overrides = None,
    robot: options.Robot = None,
    lockstep: options.InLockstep = False,
    preset: options.Preset = options.PresetName.lab,
    seed: options.Seed = None,
    robot_name: options.RobotsName = None,
    url: options.Url = None,
    out: options.Out = None,
    as_json: options.AsJson = False,
) -> None:
    """Park the robot: DIR gets the log, summary.json, trajectory.csv and a figure of the path.

    The robot's kind is that of the model. A model that would drive it the wrong way, or is of
    another geometry, is refused. In real time plant and onboard loop are started too, unless they
    run already. Where the robot is not parked in the end, the exit code is 1.

    Example: klab park --model runs/model.npz --start -1.1 -0.53 -42.68 --lockstep
    """
    from koopman_lab.evaluation.fit_to_drive import require_fit_to_drive
    from koopman_lab.predictors.predictor import require_robot
    from koopman_lab.predictors.table import load_model, prediction_of
    from offboard.lab import parking_run
    from offboard.lab.session_watch import session_listener

    loaded = load_model(model)
    changes = list(overrides or ())
    if cost is not None:
        changes.append(f"controller.cost={cost}")
    kind = robot
    if kind is None and config is None:
        kind = loaded.robot.name
    lab = options.resolve(config, changes, kind, preset, seed, url, robot_name=robot_name)
    require_robot(loaded, lab.robot.kind)
    start_pose = options.start_or_default(start, robot_type(lab.robot.kind).runs.park_start)
    prediction = prediction_of(loaded, lab.controller)
    session = parking_run.Parking(model, options.pose_from_typed(goal), start_pose, prediction)
    session.require_possible(lab)
    judged = require_fit_to_drive(loaded, lab)
    if judged.level != "good":
        show_verdicts({"model": judged})
    listener = session_listener(lab, lockstep=lockstep)
    folder = new_folder(out, "park", lab)
    summary = parking_run.park(lab, folder, listener, session)
    show(folder, summary)
    if as_json:
        print_summary(folder.summary)
    if not summary.parked:
        raise typer.Exit(ExitCode.NO)


def show(folder: RunFolder, summary: ParkSummary) -> None:
    """Print how a run ended."""
    position = "no pose measured"
    if summary.final_pose is not None:
        x1, x2, theta = summary.final_pose
        position = (
            f"x1 {x1 * 1e3:.1f} mm, x2 {x2 * 1e3:.1f} mm, theta {math.degrees(theta):.2f} deg "
            "from the goal"
        )
    verdict = "parked" if summary.parked else f"not parked ({summary.reason})"
    for pause in summary.pauses:
        err.print(f"paused for {pause.duration_s:.1f} s: {pause.reason}")
    err.print(f"{verdict} after {summary.duration_s:.1f} s: {position}: {folder.path}")

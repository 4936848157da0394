"""`klab park`: drive the robot to a goal pose with a trained model."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from koopman_lab.config.schema import LabConfig
from koopman_lab.errors import LabStateError
from koopman_lab.geometry.planar import Pose
from offboard.lab.run_folder import RunFolder, new_folder
from offboard.terminal import options
from offboard.terminal.output import err, progress

if TYPE_CHECKING:
    from koopman_lab.bus.realtime import Listener

STARTS = {"kinematic": (0.0, 0.5, 0.0), "dynamic": (-1.1, -0.53, -42.68)}
"""m, m, degrees: the paper's lab runs, sections 4 and 5.4."""
AFTER_LIMIT_S = 10.0
"""Time beyond the controller's own limit for waiting and braking."""


def park(
    model: options.ModelFile,
    start: options.Start = None,
    goal: options.Goal = (0.0, 0.0, 0.0),
    cost: Annotated[
        str | None, typer.Option("--cost", help="Stage cost: me, ce, ds (section 3.3).")
    ] = None,
    config: options.ConfigFile = None,
    overrides: options.Overrides = None,
    robot: options.Robot = None,
    lockstep: options.InLockstep = False,
    preset: options.Preset = options.PresetName.lab,
    seed: options.Seed = None,
    robot_name: options.RobotsName = None,
    url: options.Url = None,
    out: options.Out = None,
) -> None:
    """Park the robot: DIR gets the log, summary.json, trajectory.csv and a figure of the path.

    The robot's kind is that of the model. In real time plant and onboard loop are started too,
    unless they run already.

    Example: klab park --model runs/model.npz --start -1.1 -0.53 -42.68 --lockstep
    """
    from koopman_lab.koopman.bilinear_model import BilinearModel
    from koopman_lab.mpc.prediction import prediction_of
    from koopman_lab.mpc.receding_horizon import receding_horizon
    from offboard.desk.goal_message import require_reachable
    from offboard.lab.session_watch import session_listener

    loaded = BilinearModel.load(model)
    wanted = list(overrides or ())
    if cost is not None:
        wanted.append(f"controller.cost={cost}")
    kind = options.kind_of(robot)
    if kind is None and config is None:
        kind = loaded.robot_kind
    lab = options.resolve(config, wanted, kind, preset, seed, url, robot_name=robot_name)
    loaded.require_robot(lab.robot.kind)
    # Made once for what it refuses, before anything is started or written.
    receding_horizon(prediction_of(loaded, lab.controller), lab)
    require_reachable(options.pose_of(goal), lab.controller)
    listener = session_listener(lab, lockstep=lockstep)
    folder = new_folder(out, "park", lab)
    typed = start if start is not None else STARTS[lab.robot.kind]
    poses = options.pose_of(typed), options.pose_of(goal)
    summary = drive(lab, folder, model, *poses, listener)
    show(folder, summary)
    if not summary["parked"]:
        raise typer.Exit(1)


def drive(
    config: LabConfig,
    folder: RunFolder,
    model: Path,
    start: Pose,
    goal: Pose,
    listener: Listener | None,
) -> dict[str, Any]:
    """Park once and return the summary; a run that is interrupted keeps its log.

    Parameters
    ----------
    config
        The lab.
    folder
        Takes the files.
    model
        The model file.
    start, goal
        Poses in the inertial frame.
    listener
        This process's ear on the bus; None for lockstep.

    Raises
    ------
    LabError
        If the run cannot be made.
    """
    from offboard.lab.park_summary import write_park
    from offboard.lab.session import keeping_the_log

    with keeping_the_log(folder):
        if listener is None:
            facts = _in_lockstep(config, folder, model, start, goal)
        else:
            facts = _in_real_time(config, folder, model, start, goal, listener)
    return write_park(folder, config, facts)


def show(folder: RunFolder, summary: dict[str, Any]) -> None:
    """Print how a run ended."""
    pose = summary["final_pose"]
    where = "no pose measured"
    if pose is not None:
        x1, x2, theta = pose
        where = (
            f"x1 {x1 * 1e3:.1f} mm, x2 {x2 * 1e3:.1f} mm, theta {math.degrees(theta):.2f} deg "
            "from the goal"
        )
    word = "parked" if summary["parked"] else f"not parked ({summary['reason']})"
    for pause in summary["pauses"]:
        err.print(f"paused for {pause['duration_s']:.1f} s: {pause['reason']}")
    err.print(f"{word} after {summary['duration_s']:.1f} s: {where}: {folder.path}")


def _in_lockstep(
    config: LabConfig, folder: RunFolder, model: Path, start: Pose, goal: Pose
) -> dict[str, Any]:
    from koopman_lab.bus.channels import PLANT_RESET
    from offboard.controller.node import ControllerNode
    from offboard.desk.placing import reset_message
    from offboard.lab.nodes import lockstep_lab
    from offboard.lab.park_summary import outcome_facts

    node = ControllerNode(config, model, goal)
    lab = lockstep_lab(config, folder, node)
    limit_s = config.controller.time_limit_s
    try:
        lab.publish(PLANT_RESET, reset_message(start, lab.now_us))
        with progress("parking", "s at most") as report:
            lab.run(
                limit_s + AFTER_LIMIT_S,
                on_progress=lambda now_s: report(min(now_s, limit_s), limit_s),
            )
    finally:
        lab.close()
    return outcome_facts(node, missed_deadlines=0)


def _in_real_time(
    config: LabConfig,
    folder: RunFolder,
    model: Path,
    start: Pose,
    goal: Pose,
    listener: Listener,
) -> dict[str, Any]:
    from offboard.lab.place_robot import place
    from offboard.lab.session import in_real_time
    from offboard.lab.session_watch import START_LIMIT_S

    limit_s = config.controller.time_limit_s
    degrees = map(str, (goal.x1, goal.x2, math.degrees(goal.theta)))
    begun_us: list[int] = []

    def prepare(there: set[str]) -> None:
        place(listener, config, start, by_hand="onboard" in there and "plant" not in there)
        begun_us.append(listener.now_us())

    with progress("parking", "s at most") as report:

        def watch() -> None:
            elapsed_s = round((listener.now_us() - begun_us[0]) * 1e-6)
            if elapsed_s > limit_s + AFTER_LIMIT_S + START_LIMIT_S:
                raise LabStateError(
                    f"controller: still waits after {elapsed_s} s; it needs camera frames, wheel "
                    "odometry, a logger, and an onboard loop without emergency stop"
                )
            report(min(elapsed_s, limit_s), limit_s)

        return in_real_time(
            config,
            folder,
            listener,
            "controller",
            *("--model", model.absolute()),
            *("--goal", *degrees),
            prepare=prepare,
            watch=watch,
        )

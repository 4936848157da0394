"""`klab compare`: the paper's lab runs, one controller after the other."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

from koopman_lab.config.change import changed
from koopman_lab.config.cost_table import COSTS
from koopman_lab.robots.table import robot_type
from offboard.commands.park import show
from offboard.lab.run_folder import RunFolder, new_folder
from offboard.terminal import options
from offboard.terminal.choices import name_option
from offboard.terminal.needs import needs
from offboard.terminal.output import err

if TYPE_CHECKING:
    from koopman_lab.config.schema import LabConfig
    from koopman_lab.figures.path_figure import Curve
    from offboard.desk.results import ParkSummary


NOMINAL = "nominal"
"""A controller that predicts with the nominal equations, with the cost ``me``."""


KEPT = ("parked", "reason", "final_pose", "duration_s", "solve_ms", "pose_age_ms")
"""Of each run's summary, in that of the comparison."""


def _controller_names() -> tuple[str, ...]:
    """Return the choices of ``--controller``."""
    return (*COSTS.names(), NOMINAL)


def _controller_changes(name: str) -> dict[str, Any]:
    """Return what a controller changes in the configuration's section ``controller``."""
    return {"cost": "me", "predict": "nominal"} if name == NOMINAL else {"cost": name}


@needs("desk")
def compare(
    model: options.ModelFile,
    controller: Annotated[
        list[str] | None,
        name_option(
            *("--controller", "controller", _controller_names),
            "A cost with the model, or the nominal equations with the cost me; several may be "
            "named. Default: those of the paper.",
        ),
    ] = None,
    start: options.Start = None,
    config: options.ConfigFile = None,
    overrides: options.Overrides = None,
    lockstep: options.InLockstep = False,
    preset: options.Preset = options.PresetName.lab,
    seed: options.Seed = None,
    robot_name: options.RobotsName = None,
    url: options.Url = None,
    out: options.Out = None,
) -> None:
    """Park with several controllers from one start and draw them over each other.

    Each is placed anew, within the accuracy of a hand. DIR gets a folder for each as `klab park`
    leaves it, one figure of all (path, value function, deviation sideways) and summary.json.

    Example: klab compare --model runs/model.npz --lockstep --out runs/lab-runs
    """
    from koopman_lab.evaluation.fit_to_drive import require_fit_to_drive
    from koopman_lab.predictors.predictor import require_robot
    from koopman_lab.predictors.table import load_model, prediction_of
    from offboard.lab import parking_run
    from offboard.lab.session_watch import session_listener

    loaded = load_model(model)
    kind = loaded.robot.name if config is None else None
    lab = options.resolve(config, overrides, kind, preset, seed, url, robot_name=robot_name)
    require_robot(loaded, lab.robot.kind)
    names = controller or (*COSTS.builtin_names(), NOMINAL)
    labs = {name: changed(lab, "controller", **_controller_changes(name)) for name in names}
    start_pose = options.start_or_default(start, robot_type(lab.robot.kind).runs.park_start)
    sessions = {
        name: parking_run.Parking(
            model, start=start_pose, prediction=prediction_of(loaded, variant.controller)
        )
        for name, variant in labs.items()
    }
    for name, variant in labs.items():
        sessions[name].require_possible(variant)
        require_fit_to_drive(loaded, variant)
    comparison = new_folder(out, "compare", lab)
    ends, curves = {}, []
    for name, variant in labs.items():
        folder = new_folder(comparison.path / name, "park", variant)
        listener = session_listener(variant, lockstep=lockstep)
        ends[name] = parking_run.park(variant, folder, listener, sessions[name])
        show(folder, ends[name])
        curves.append(_curve(name, folder))
    _write_comparison(comparison, lab, ends, curves)


def _curve(name: str, folder: RunFolder) -> Curve:
    import numpy as np

    from koopman_lab.figures.path_figure import Curve
    from offboard.lab.parking_run import TRAJECTORY

    rows = np.genfromtxt(folder.path / TRAJECTORY, delimiter=",", names=True)
    poses = np.column_stack([rows["x1_m"], rows["x2_m"], rows["theta_rad"]])
    return Curve(name, rows["time_s"], poses, rows["value"])


def _write_comparison(
    comparison: RunFolder, lab: LabConfig, ends: dict[str, ParkSummary], curves: list[Curve]
) -> None:
    from koopman_lab.figures.path_figure import draw_paths

    controllers = {
        name: {key: value for key, value in end.model_dump().items() if key in KEPT}
        for name, end in ends.items()
    }
    comparison.write_summary(lab, {"what": "comparison", "controllers": controllers})
    draw_paths(comparison.path / "paths", curves, deviation=True)
    err.print(f"figure: {comparison.path / 'paths.png'}")

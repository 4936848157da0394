"""`klab demo`: the main job from nothing to a parked robot."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from koopman_lab.eventlog.log_name import CALIBRATION_NAME
from koopman_lab.robots.table import robot_type
from offboard.commands.calibrate import show as show_session
from offboard.commands.data.train_model import train_and_report
from offboard.commands.park import show as show_park
from offboard.lab.run_folder import new_folder
from offboard.terminal import options
from offboard.terminal.exit_codes import ExitCode
from offboard.terminal.needs import needs
from offboard.terminal.output import err, out, print_summary

if TYPE_CHECKING:
    from offboard.desk.results import ParkSummary

SECONDS_PER_SEGMENT = 11.5
"""Measured: klab calibrate --lockstep, either robot."""
LARGEST = (0.030, 0.010, math.radians(5.0))
"""Final deviations (m, m, rad) within which the demo counts as a success."""


@needs("desk")
def demo(
    robot: options.Robot = None,
    lockstep: options.InLockstep = False,
    segments: Annotated[
        int | None, typer.Option("--segments", min=1, help="Segments per basis input.")
    ] = None,
    config: options.ConfigFile = None,
    overrides: options.Overrides = None,
    preset: options.Preset = options.PresetName.lab,
    seed: options.Seed = None,
    robot_name: options.RobotsName = None,
    url: options.Url = None,
    directory: options.Out = None,
    as_json: options.AsJson = False,
) -> None:
    """Calibrate, train, park, and show the result.

    In real time over LCM the kinematic robot takes about two and a half minutes; --lockstep takes
    seconds. Where the robot does not stand within the bounds in the end, the exit code is 1.

    Example: klab demo --robot dynamic --lockstep --out runs/demo
    """
    from offboard.lab.calibration import calibrate
    from offboard.lab.parking_run import Parking, park
    from offboard.lab.session_watch import session_listener

    lab = options.resolve(config, overrides, robot, preset, seed, url, robot_name)
    standard = robot_type(lab.robot.kind).runs
    count = segments if segments is not None else standard.demo_segments
    changes = [*(overrides or ()), f"sampler.segments_per_basis={count}"]
    lab = options.resolve(config, changes, robot, preset, seed, url, robot_name)
    listener = session_listener(lab, lockstep=lockstep)
    top = new_folder(directory, "demo", lab)
    runs = count * len(lab.sampler.basis_inputs)
    if not lockstep:
        minutes = runs * SECONDS_PER_SEGMENT / 60.0
        err.print(f"{lab.robot.kind} robot, {runs} segments in real time: about {minutes:.0f} min")
    session = new_folder(top.path / CALIBRATION_NAME, CALIBRATION_NAME, lab)
    calibration = calibrate(lab, session, listener)
    show_session(session, calibration)
    model = train_and_report([session.path], top.path / "model.npz", silent=as_json)
    run = new_folder(top.path / "park", "park", lab)
    start = options.start_or_default(None, standard.park_start)
    result = park(lab, run, listener, Parking(model, start=start))
    show_park(run, result)
    passed = _verdict(result)
    parts = {"calibration": calibration.model_dump(), "park": result.model_dump()}
    top.write_summary(lab, {"what": "demo", "passed": passed} | parts)
    if as_json:
        print_summary(top.summary)
    else:
        _table(result, run.path / "path.png", passed=passed)
    if not passed:
        raise typer.Exit(ExitCode.NO)


def _verdict(result: ParkSummary) -> bool:
    pose = result.final_pose
    return pose is not None and all(
        abs(value) <= limit for value, limit in zip(pose, LARGEST, strict=True)
    )


def _table(result: ParkSummary, figure: Path, *, passed: bool) -> None:
    from rich.table import Table

    table = Table(title="parked within the bounds" if passed else "NOT parked within the bounds")
    for column in ("", "at the end", "allowed"):
        table.add_column(column, justify="right")
    x1, x2, theta = result.final_pose or (math.nan,) * 3
    table.add_row("x1", f"{x1 * 1e3:.1f} mm", f"{LARGEST[0] * 1e3:.0f} mm")
    table.add_row("x2", f"{x2 * 1e3:.2f} mm", f"{LARGEST[1] * 1e3:.0f} mm")
    table.add_row("theta", f"{math.degrees(theta):.2f} deg", f"{math.degrees(LARGEST[2]):.0f} deg")
    table.add_row("duration", f"{result.duration_s:.1f} s", "")
    solve = result.solve_ms.p99
    table.add_row("solve time p99", "-" if solve is None else f"{solve:.1f} ms", "")
    table.add_row("missed deadlines", str(result.missed_deadlines), "")
    table.add_row("camera messages lost", str(result.mocap_messages_lost), "")
    out.print(table)
    out.print(f"path: {figure}")

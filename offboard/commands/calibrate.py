"""`klab calibrate`: a sampling session from start to summary."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from koopman_lab.config.change import changed
from koopman_lab.errors import ConfigError
from offboard.lab.run_folder import RunFolder, new_folder
from offboard.terminal import options
from offboard.terminal.exit_codes import ExitCode
from offboard.terminal.output import err, print_summary, show_verdicts

if TYPE_CHECKING:
    from offboard.desk.results import CalibrationSummary


def calibrate(
    config: options.ConfigFile = None,
    overrides: options.Overrides = None,
    robot: options.Robot = None,
    segments: Annotated[
        int | None, typer.Option("--segments", min=1, help="Segments per basis input.")
    ] = None,
    lockstep: options.InLockstep = False,
    preset: options.Preset = options.PresetName.lab,
    seed: options.Seed = None,
    robot_name: options.RobotsName = None,
    url: options.Url = None,
    out: options.Out = None,
    as_json: options.AsJson = False,
    resume: Annotated[
        Path | None,
        typer.Option(
            "--resume",
            metavar="DIR",
            help="Go on with the interrupted session in DIR, with its configuration.",
        ),
    ] = None,
) -> None:
    """Record a calibration session: DIR/session.lcm, DIR/config.yaml, DIR/summary.json.

    In real time plant and onboard loop are started too, unless they run already. What is recorded
    is judged; without usable samples the session is not complete, and the exit code is 1. With
    --json the summary is printed too.

    Example: klab calibrate --robot kinematic --lockstep --seed 1 --out runs/calibration
    """
    from koopman_lab.config.load import read_record
    from offboard.lab import calibration
    from offboard.lab.session_watch import session_listener

    session = None
    if resume is not None:
        if any(x is not None for x in (config, overrides, robot, segments, seed, robot_name, out)):
            raise ConfigError(
                f"--resume {resume}: the session goes on with its own configuration; of the other "
                "options only --lockstep and --url may be given"
            )
        folder = RunFolder(resume)
        session = calibration.Calibration(resumed=folder)
        lab = read_record(folder.config)
        if url is not None:
            lab = changed(lab, "bus", url=url)
        listener = session_listener(lab, lockstep=lockstep)
        # Its processes read it there, in the keys of this version and with this bus.
        folder.write_config(lab)
        if session.before is not None and session.before.skipped_bytes:
            skipped = session.before.skipped_bytes
            err.print(f"{skipped} damaged bytes at the end of the log passed over")
    else:
        changes = list(overrides or ())
        if segments is not None:
            changes.append(f"sampler.segments_per_basis={segments}")
        lab = options.resolve(config, changes, robot, preset, seed, url, robot_name=robot_name)
        listener = session_listener(lab, lockstep=lockstep)
        folder = new_folder(out, "calibration", lab)
    summary = calibration.calibrate(lab, folder, listener, session)
    show(folder, summary)
    if as_json:
        print_summary(folder.summary)
    if not summary.complete:
        raise typer.Exit(ExitCode.NO)


def show(folder: RunFolder, summary: CalibrationSummary) -> None:
    """Print what a session brought."""
    samples = ", ".join(f"u_{i}: {n}" for i, n in summary.samples.items())
    pace = f" ({summary.times_real_time:.0f} times real time)" if summary.lockstep else ""
    err.print(
        f"{summary.segments} of {summary.segments_wanted} segments in "
        f"{summary.duration_s:.1f} s{pace}, samples {samples or 'none'}, "
        f"{summary.messages_lost} messages lost: {folder.path}"
    )
    if summary.reason:
        err.print(f"ended: {summary.reason}")
    if summary.redraws:
        reasons = ", ".join(f"{reason}: {n}" for reason, n in summary.redraws.items())
        err.print(f"drawn again: {reasons}")
    show_verdicts({"session and data": summary.verdict})

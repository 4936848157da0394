"""`klab calibrate`: a sampling session from start to summary."""

from __future__ import annotations

import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from koopman_lab.config.schema import LabConfig
from koopman_lab.errors import ConfigError, LabError
from koopman_lab.units import US_PER_S
from offboard.lab.run_folder import RunFolder, new_folder
from offboard.terminal import options
from offboard.terminal.output import err, progress

if TYPE_CHECKING:
    from koopman_lab.bus.realtime import Listener
    from offboard.sampler.resume import Interrupted

LOCKSTEP_LIMIT_S = 100_000.0
"""Virtual time after which a session that never ends is given up."""


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

    In real time plant and onboard loop are started too, unless they run already.

    Example: klab calibrate --robot kinematic --lockstep --seed 1 --out runs/calibration
    """
    from offboard.lab.session_watch import session_listener
    from offboard.sampler.resume import interrupted

    if resume is not None:
        if any(x is not None for x in (config, overrides, robot, segments, seed, robot_name, out)):
            raise ConfigError(
                f"--resume {resume}: the session goes on with its own configuration; of the other "
                "options only --lockstep and --url may be given"
            )
        folder = RunFolder(resume)
        before = interrupted(resume)
        lab = options.resolve(folder.config, None, None, url=url)
        listener = session_listener(lab, lockstep=lockstep)
        if before.skipped_bytes:
            err.print(f"{before.skipped_bytes} damaged bytes at the end of the log passed over")
        _finish(folder, record(lab, folder, listener, before))
        return
    wanted = list(overrides or ())
    if segments is not None:
        wanted.append(f"sampler.segments_per_basis={segments}")
    lab = options.resolve(
        config, wanted, options.kind_of(robot), preset, seed, url, robot_name=robot_name
    )
    listener = session_listener(lab, lockstep=lockstep)
    folder = new_folder(out, "calibration", lab)
    _finish(folder, record(lab, folder, listener))


def _finish(folder: RunFolder, summary: dict[str, Any]) -> None:
    show(folder, summary)
    if not summary["complete"]:
        raise typer.Exit(1)


def record(
    config: LabConfig,
    folder: RunFolder,
    listener: Listener | None,
    before: Interrupted | None = None,
) -> dict[str, Any]:
    """Run the session and return its summary; a session that is interrupted keeps its log.

    Parameters
    ----------
    config
        The lab.
    folder
        Takes the files.
    listener
        This process's ear on the bus; None for lockstep.
    before
        The session in the folder that is to go on.

    Raises
    ------
    LabError
        If the session cannot be run.
    """
    from offboard.lab.session import keeping_the_log

    mode = " --lockstep" if listener is None else ""
    then = f"`klab calibrate --resume {folder.path}{mode}` goes on with the session"
    with keeping_the_log(folder, then):
        if listener is None:
            facts = _in_lockstep(config, folder, before)
        else:
            facts = _in_real_time(config, folder, listener, resume=before is not None)
    facts |= _data(folder, complete=facts["complete"], salvage=before is not None)
    summary = {"what": "calibrate", "lockstep": listener is None} | facts
    folder.write_summary(config, summary)
    return summary


def show(folder: RunFolder, summary: dict[str, Any]) -> None:
    """Print what a session brought."""
    samples = ", ".join(f"u_{i}: {n}" for i, n in summary["samples"].items())
    pace = f" ({summary['times_real_time']:.0f} times real time)" if summary["lockstep"] else ""
    err.print(
        f"{summary['segments']} of {summary['segments_wanted']} segments in "
        f"{summary['duration_s']:.1f} s{pace}, samples {samples or 'none'}, "
        f"{summary['messages_lost']} messages lost: {folder.path}"
    )
    if summary["redraws"]:
        reasons = ", ".join(f"{reason}: {n}" for reason, n in summary["redraws"].items())
        err.print(f"drawn again: {reasons}")


def _in_lockstep(
    config: LabConfig, folder: RunFolder, before: Interrupted | None
) -> dict[str, Any]:
    from offboard.lab.nodes import lockstep_lab
    from offboard.sampler.node import SamplerNode

    node = SamplerNode(config, before.progress if before else None)
    lab = lockstep_lab(config, folder, node, before.next_us if before else None)
    try:
        began_s, began_us = time.perf_counter(), lab.now_us
        with progress("calibrating", "segments") as report:

            def show_sampler(now_s: float) -> None:
                sampler = node.sampler
                samples = f"{sampler.frames} samples, {now_s:.0f} s of virtual time"
                report(sampler.done, sampler.total, samples)

            lab.run(LOCKSTEP_LIMIT_S, on_progress=show_sampler)
            show_sampler(lab.now_us / US_PER_S)
        passed_s = (lab.now_us - began_us) / US_PER_S
        speed = {"times_real_time": passed_s / (time.perf_counter() - began_s)}
    finally:
        lab.close()
    return node.summary() | {"missed_deadlines": 0} | speed


def _in_real_time(
    config: LabConfig, folder: RunFolder, listener: Listener, *, resume: bool
) -> dict[str, Any]:
    import lcmtypes
    from koopman_lab.bus.channels import MOCAP_POSE, ONBOARD_STATUS, SAMPLER_STATE
    from offboard.lab.session import in_real_time
    from offboard.lab.session_watch import StartWatch

    name = config.robot.name
    start = StartWatch(
        "sampler",
        f"{MOCAP_POSE.name(name)} and {ONBOARD_STATUS.name(name)}; are the cameras and the onboard "
        "loop running?",
    )
    with progress("calibrating", "segments") as report:

        def show_state(state: lcmtypes.sampler_state_t) -> None:
            start.begun = start.begun or state.phase != state.WAIT
            report(state.segments_done, state.segments_total, f"{state.samples} samples")

        listener.subscribe(SAMPLER_STATE, show_state)
        arguments = ["--resume", str(folder.path)] if resume else []
        facts = in_real_time(
            config,
            folder,
            listener,
            "sampler",
            *arguments,
            resume=resume,
            watch=lambda: start.check(listener.now_us()),
        )
    return facts | {"times_real_time": 1.0}


def _data(folder: RunFolder, *, complete: bool, salvage: bool) -> dict[str, Any]:
    from koopman_lab.bus.channels import split_name
    from koopman_lab.data.dataset import DataSet
    from koopman_lab.data.decode import SessionLog

    log = SessionLog(folder.log, salvage=salvage)
    try:
        samples = {str(i): len(x) for i, x in DataSet.from_log(log).X.items()}
    except LabError:
        if complete:
            raise
        samples = {}
    return {
        "duration_s": log.duration_s,
        "samples": samples,
        "clock_error_s": log.clock_error_s(),
        "messages_lost": sum(
            # Beside the logger of `klab up` two number these channels, each on its own.
            c.lost
            for name, c in log.channels.items()
            if split_name(name)[1].publisher != "logger"
        ),
    }

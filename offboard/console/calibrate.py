"""`klab calibrate`: a sampling session from start to summary."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

import typer

from koopman_lab.config.schema import LabConfig
from koopman_lab.errors import LabError, LabStateError
from offboard.console import options
from offboard.console.folder import RunFolder, new_folder
from offboard.console.terminal import err, progress

if TYPE_CHECKING:
    from koopman_lab.bus.realtime import Listener

LOCKSTEP_LIMIT_S = 100_000.0
"""Virtual time after which a session that never ends is given up."""
START_LIMIT_S = 30.0
"""Real time within which the sampler must begin."""


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
) -> None:
    """Record a calibration session: DIR/session.lcm, DIR/config.yaml, DIR/summary.json.

    In real time plant and onboard loop are started too, unless they run already.

    Example: klab calibrate --robot kinematic --lockstep --seed 1 --out runs/calibration
    """
    from offboard.console.watch import ear

    wanted = list(overrides or ())
    if segments is not None:
        wanted.append(f"sampler.segments_per_basis={segments}")
    lab = options.resolve(
        config, wanted, options.kind_of(robot), preset, seed, url, robot_name=robot_name
    )
    listener = ear(lab, lockstep=lockstep)
    folder = new_folder(out, "calibration", lab)
    summary = record(lab, folder, listener)
    show(folder, summary)
    if not summary["complete"]:
        raise typer.Exit(1)


def record(config: LabConfig, folder: RunFolder, listener: Listener | None) -> dict[str, Any]:
    """Run the session and return its summary; a session that is interrupted keeps its log.

    Parameters
    ----------
    config
        The lab.
    folder
        Takes the files.
    listener
        This process's ear on the bus; None for lockstep.

    Raises
    ------
    LabError
        If the session cannot be run.
    """
    from offboard.console.session import keeping_the_log

    with keeping_the_log(folder):
        if listener is None:
            facts = _in_lockstep(config, folder)
        else:
            facts = _in_real_time(config, folder, listener)
    facts |= _data(folder, complete=facts["complete"])
    summary = {"what": "calibrate", "lockstep": listener is None} | facts
    folder.write_summary(config, summary)
    return summary


def show(folder: RunFolder, summary: dict[str, Any]) -> None:
    """Print what a session brought."""
    samples = ", ".join(f"u_{i}: {n}" for i, n in summary["samples"].items())
    err.print(
        f"{summary['segments']} of {summary['segments_wanted']} segments in "
        f"{summary['duration_s']:.1f} s, samples {samples or 'none'}, "
        f"{summary['messages_lost']} messages lost: {folder.path}"
    )


def _in_lockstep(config: LabConfig, folder: RunFolder) -> dict[str, Any]:
    from offboard.console.nodes import lockstep_lab
    from offboard.sampler.node import SamplerNode

    node = SamplerNode(config)
    lab = lockstep_lab(config, folder, node)
    try:
        with progress("calibrating") as report:
            lab.run(
                LOCKSTEP_LIMIT_S,
                on_progress=lambda now_s: report(
                    node.sampler.done, node.sampler.total, f"{now_s:.0f} s of virtual time"
                ),
            )
            report(node.sampler.done, node.sampler.total, "")
    finally:
        lab.close()
    return node.summary() | {"missed_deadlines": 0}


def _in_real_time(config: LabConfig, folder: RunFolder, listener: Listener) -> dict[str, Any]:
    import lcmtypes
    from koopman_lab.bus.channels import MOCAP_POSE, ONBOARD_STATUS, SAMPLER_STATE
    from koopman_lab.units import US_PER_S
    from offboard.console.session import in_real_time

    with progress("calibrating") as report:
        began = False
        first_us: int | None = None

        def show_state(state: lcmtypes.sampler_state_t) -> None:
            nonlocal began
            began = began or state.phase != lcmtypes.sampler_state_t.WAIT
            report(state.segments_done, state.segments_total, f"{state.samples} frames")

        listener.subscribe(SAMPLER_STATE, show_state)

        def watch() -> None:
            nonlocal first_us
            now_us = listener.now_us()
            first_us = first_us or now_us
            if not began and now_us - first_us > START_LIMIT_S * US_PER_S:
                raise LabStateError(
                    f"sampler: has not begun within {START_LIMIT_S:g} s; it waits for "
                    f"{MOCAP_POSE.name(config.robot.name)} and "
                    f"{ONBOARD_STATUS.name(config.robot.name)}; are the cameras and the onboard "
                    "loop running?"
                )

        return in_real_time(config, folder, listener, "sampler", watch=watch)


def _data(folder: RunFolder, *, complete: bool) -> dict[str, Any]:
    from koopman_lab.bus.channels import split_name
    from koopman_lab.data.dataset import DataSet
    from koopman_lab.data.decode import SessionLog

    log = SessionLog(folder.log)
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

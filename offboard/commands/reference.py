"""`klab reference`: runs on known shapes in open loop, which models are validated with."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Annotated, Any

import typer

from koopman_lab.config.schema import LabConfig
from offboard.lab.run_folder import RunFolder, new_folder
from offboard.terminal import options
from offboard.terminal.output import err, progress

if TYPE_CHECKING:
    import lcmtypes
    from koopman_lab.bus.realtime import Listener
    from offboard.reference.shapes import Shape

LOCKSTEP_LIMIT_S = 100_000.0
"""Virtual time after which a session that never ends is given up."""


def reference(
    shape: options.ReferenceShape,
    runs: Annotated[
        int | None, typer.Option("--runs", min=1, help="How many; default reference.runs.")
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
    """Drive a shape again and again in open loop: DIR/session.lcm, config.yaml, summary.json.

    Each run begins at rest within placement accuracy of the same pose; a real robot is placed by
    hand. `klab validate` measures models with what is recorded. In real time plant and onboard
    loop are started too, unless they run already.

    Example: klab reference --shape infinity --runs 20 --robot dynamic --lockstep
    """
    from offboard.lab.session import keeping_the_log
    from offboard.lab.session_watch import session_listener
    from offboard.reference.shapes import Shape, input_sequence

    wanted = list(overrides or ())
    if runs is not None:
        wanted.append(f"reference.runs={runs}")
    lab = options.resolve(
        config, wanted, options.kind_of(robot), preset, seed, url, robot_name=robot_name
    )
    chosen = Shape[shape.value.upper()]
    # Made once for what it refuses, before anything is started or written.
    input_sequence(lab, chosen)
    listener = session_listener(lab, lockstep=lockstep)
    folder = new_folder(out, f"reference-{shape.value}", lab)
    with keeping_the_log(folder):
        if listener is None:
            facts = _in_lockstep(lab, folder, chosen)
        else:
            facts = _in_real_time(lab, folder, chosen, listener)
    summary = {"what": "reference", "lockstep": lockstep} | facts | _data(folder)
    folder.write_summary(lab, summary)
    err.print(
        f"{summary['runs']} of {summary['runs_wanted']} runs ({summary['shape']}) in "
        f"{summary['duration_s']:.1f} s, {summary['mocap_messages_lost']} frames lost: "
        f"{folder.path}"
    )
    if not summary["complete"]:
        raise typer.Exit(1)


def _in_lockstep(config: LabConfig, folder: RunFolder, shape: Shape) -> dict[str, Any]:
    from offboard.lab.nodes import lockstep_lab
    from offboard.reference.node import ReferenceNode

    node = ReferenceNode(config, shape)
    lab = lockstep_lab(config, folder, node)
    try:
        with progress("driving", "runs") as report:
            lab.run(
                LOCKSTEP_LIMIT_S,
                on_progress=lambda now_s: report(
                    node.driver.done, node.driver.total, f"{now_s:.0f} s of virtual time"
                ),
            )
            report(node.driver.done, node.driver.total)
    finally:
        lab.close()
    return node.summary() | {"missed_deadlines": 0}


def _in_real_time(
    config: LabConfig, folder: RunFolder, shape: Shape, listener: Listener
) -> dict[str, Any]:
    from koopman_lab.bus.channels import MOCAP_POSE, ONBOARD_STATUS, REFERENCE_STATE
    from offboard.lab.session import in_real_time
    from offboard.lab.session_watch import StartWatch

    name = config.robot.name
    start = StartWatch(
        "reference",
        f"{ONBOARD_STATUS.name(name)}, and for {MOCAP_POSE.name(name)} to show the robot at its "
        "start; place it there by hand, or see whether cameras and onboard loop are running",
    )
    with progress("driving", "runs") as report:

        def show_state(state: lcmtypes.reference_state_t) -> None:
            start.begun = start.begun or state.phase not in (state.WAIT, state.PLACE)
            report(state.runs_done, state.runs_total, _note(state))

        listener.subscribe(REFERENCE_STATE, show_state)
        return in_real_time(
            config,
            folder,
            listener,
            "reference",
            *("--shape", shape.name.lower()),
            watch=lambda: start.check(listener.now_us()),
        )


def _note(state: lcmtypes.reference_state_t) -> str:
    if state.phase != state.PLACE:
        return ""
    degrees = math.degrees(state.start_theta_rad)
    return (
        f"place the robot at x1 {state.start_x1_m:g} m, x2 {state.start_x2_m:g} m, "
        f"theta {degrees:.0f} deg"
    )


def _data(folder: RunFolder) -> dict[str, Any]:
    from koopman_lab.bus.channels import MOCAP_POSE
    from koopman_lab.data.decode import SessionLog

    log = SessionLog(folder.log)
    return {
        "duration_s": log.duration_s,
        "mocap_messages_lost": log.channels[MOCAP_POSE.name(log.robot_name)].lost,
        "clock_error_s": log.clock_error_s(),
    }

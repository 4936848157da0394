"""`klab reference`: runs on known shapes in open loop, which models are validated with."""

from __future__ import annotations

from typing import Annotated

import typer

from offboard.lab.run_folder import new_folder
from offboard.terminal import options
from offboard.terminal.exit_codes import ExitCode
from offboard.terminal.output import err, print_summary


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
    as_json: options.AsJson = False,
) -> None:
    """Drive a shape again and again in open loop: DIR/session.lcm, config.yaml, summary.json.

    Each run begins at rest within placement accuracy of the same pose; a real robot is placed by
    hand. `klab validate` measures models with what is recorded. In real time plant and onboard
    loop are started too, unless they run already.

    Example: klab reference --shape infinity --runs 20 --robot dynamic --lockstep
    """
    from offboard.lab.reference_runs import drive_reference
    from offboard.lab.session_watch import session_listener
    from offboard.reference.shapes import Shape, input_sequence

    changes = list(overrides or ())
    if runs is not None:
        changes.append(f"reference.runs={runs}")
    lab = options.resolve(config, changes, robot, preset, seed, url, robot_name=robot_name)
    chosen = Shape[shape.value.upper()]
    # Made once for what it refuses, before anything is started or written.
    input_sequence(lab, chosen)
    listener = session_listener(lab, lockstep=lockstep)
    folder = new_folder(out, f"reference-{shape.value}", lab)
    summary = drive_reference(lab, folder, listener, chosen)
    err.print(
        f"{summary.runs} of {summary.runs_wanted} runs ({summary.shape}) in "
        f"{summary.duration_s:.1f} s, {summary.mocap_messages_lost} frames lost: {folder.path}"
    )
    if as_json:
        print_summary(folder.summary)
    if not summary.complete:
        raise typer.Exit(ExitCode.NO)

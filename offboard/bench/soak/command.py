"""`klab bench soak`: break a lab in real time every 20 s, and judge it by the true motion."""

from __future__ import annotations

import json
from collections import defaultdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from offboard.terminal import options
from offboard.terminal.exit_codes import ExitCode
from offboard.terminal.needs import needs
from offboard.terminal.output import out, progress

if TYPE_CHECKING:
    from rich.table import Table

    from offboard.bench.soak.resources import Resources
    from offboard.bench.soak.soak import Soaked, Struck


@needs("desk")
def soak(
    model: Annotated[Path, typer.Option("--model", metavar="FILE", help="Parks the robot.")],
    config: options.ConfigFile = None,
    overrides: options.Overrides = None,
    preset: options.Preset = options.PresetName.lab,
    seed: options.Seed = None,
    minutes: Annotated[float, typer.Option("--minutes", min=0.1, help="For how long.")] = 60.0,
    every_s: Annotated[
        float, typer.Option("--every-s", min=0.0, help="From one fault to the next at least.")
    ] = 20.0,
    url: options.Url = None,
    folder: options.Out = None,
    as_json: options.AsJson = False,
) -> None:
    """Let a robot park and calibrate in real time, and break something every 20 s.

    What breaks is drawn from the table of faults and from what can happen to processes: killed,
    hanging, a second session, the emergency stop. The plant's truth says how far the robot drove
    without permission: after it had to stand, or while no session drove it. The exit code is 1 if
    it did at all, stood too late, or left the floor.

    Example: klab bench soak --model runs/model.npz --minutes 60
    """
    from dataclasses import asdict

    from koopman_lab.predictors.table import load_model
    from offboard.bench.soak.soak import soak as run_soak
    from offboard.lab.run_folder import new_folder
    from offboard.lab.session_runner import keeping_the_log

    kind = None if config else load_model(model).robot.name
    lab = options.resolve(config, overrides, kind, preset, seed, url)
    lab.require_simulation()
    listener = options.listen(lab)
    run, seconds = new_folder(folder, "soak", lab), 60.0 * minutes
    with keeping_the_log(run), progress("breaking", "s") as report:
        soaked = run_soak(
            lab,
            run,
            listener,
            model.absolute(),
            seconds,
            every_s,
            lambda passed_s, what: report(round(passed_s), round(seconds), what),
        )
    if as_json:
        out.print_json(json.dumps(asdict(soaked)))
    else:
        out.print(_strikes_table(soaked.strikes, lab.robot.kind))
        out.print(_resources_table(soaked.resources))
        out.print(_summary(soaked))
    if not all(map(holds, soaked.strikes)):
        raise typer.Exit(ExitCode.NO)


def holds(row: Struck) -> bool:
    """Return whether the robot stood in time, on the floor, and nowhere moved unasked."""
    return row.forbidden_m == 0.0 and row.beyond_floor_m == 0.0


def _strikes_table(strikes: list[Struck], kind: str) -> Table:
    from rich.table import Table

    table = Table(title=f"soak of the {kind} robot")
    table.add_column("what broke", overflow="fold")
    for column in ("times", "stands\nafter\n(s)", "allow-\ned (s)", "without\nleave\n(mm)", "lost"):
        table.add_column(column, justify="right", no_wrap=True)
    rows: dict[tuple[str, str], list[Struck]] = defaultdict(list)
    for row in strikes:
        rows[row.strike, row.activity].append(row)
    for (name, activity), group in sorted(rows.items()):
        stood = [row.stood_after_s for row in group if row.under_way and row.stood_after_s]
        bound_s = group[0].bound_s
        table.add_row(
            f"{name} ({activity})",
            str(len(group)),
            f"{max(stood):.2f}" if stood and bound_s is not None else "",
            "drives on" if bound_s is None else f"{bound_s:.2f}",
            f"{1000.0 * sum(row.forbidden_m for row in group):.1f}",
            str(sum(row.lost for row in group)),
        )
    return table


def _resources_table(resources: list[Resources]) -> Table:
    from rich.table import Table

    table = Table("process", title="what the longest-lived held, first and last")
    for column in ("seen", "memory (MB)", "descriptors"):
        table.add_column(column, justify="right")
    for seen in resources:
        table.add_row(
            seen.name,
            str(seen.looks),
            f"{seen.first_mb:.1f}, {seen.last_mb:.1f}",
            f"{seen.first_descriptors}, {seen.last_descriptors}",
        )
    return table


def _summary(soaked: Soaked) -> str:
    strikes: list[Any] = soaked.strikes
    under_way = sum(row.under_way for row in strikes)
    without_m = sum(row.forbidden_m for row in strikes)
    floor_m = max((row.beyond_floor_m for row in strikes), default=0.0)
    return (
        f"{len(strikes)} strikes, {under_way} of them while the robot drove; "
        f"{soaked.driven_m:.1f} m driven, {1000.0 * without_m:.1f} mm without permission, "
        f"{floor_m:.2f} m beyond the floor, {sum(row.lost for row in strikes)} messages lost"
    )

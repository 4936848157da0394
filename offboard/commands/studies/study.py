"""`klab study`: closed-loop studies on the nominal equations."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from koopman_lab.config.cost_table import COSTS
from koopman_lab.files import writing_where_named
from koopman_lab.robots.table import robot_type
from offboard.commands.studies import study_starts
from offboard.terminal import options
from offboard.terminal.choices import Commands
from offboard.terminal.needs import needs
from offboard.terminal.output import err, out, progress

app = Commands(help="Study the closed loop in simulation.", no_args_is_help=True)


for _command in study_starts.COMMANDS:
    app.command()(_command)


@app.command()
@needs("desk")
def weights(
    model: Annotated[Path, typer.Option("--model", metavar="FILE", help="From `klab train`.")],
    file: Annotated[Path, typer.Option("--out", metavar="FILE", help="CSV file of all runs.")],
    start: Annotated[
        tuple[float, float, float] | None,
        typer.Option("--start", metavar="X Y THETA", help="m, m, degrees; default as the paper."),
    ] = None,
    cost: options.Costs = None,
    factors: Annotated[
        str, typer.Option("--factors", metavar="F,F,...", help="Of the weights of each group.")
    ] = "0.1,1,10",
    duration_s: Annotated[
        float | None, typer.Option("--duration", metavar="S", min=0.1, help="Of each run, s.")
    ] = None,
    config: options.ConfigFile = None,
    overrides: options.Overrides = None,
    as_json: options.AsJson = False,
) -> None:
    """Show over a grid of weights and bounds how far each cost leaves the robot from the goal.

    Without --cost: those of the paper.

    Example: klab study weights --model runs/model.npz --start 0 0.5 0 --out runs/weights.csv
    """
    from koopman_lab.files import write_csv
    from koopman_lab.predictors.predictor import require_robot
    from koopman_lab.predictors.table import load_model, prediction
    from koopman_lab.studies import weights as studies

    loaded = load_model(model)
    changes = [f"controller.dt_s={loaded.dt_s}", *(overrides or ())]
    lab = options.resolve(config, changes, None if config else loaded.robot.name)
    require_robot(loaded, lab.robot.kind)
    grid = studies.settings(cost or COSTS.builtin_names(), options.parse_factors(factors))
    robot = robot_type(lab.robot.kind)
    x0 = robot.state(options.start_or_default(start, robot.runs.simulate_start))
    seconds = duration_s if duration_s is not None else robot.runs.simulate_s
    rows = []
    with progress("simulating") as report:
        for row in studies.study(lab, prediction(loaded), x0, seconds, grid):
            rows.append(row)
            report(len(rows), len(grid), row.setting.cost)
    with writing_where_named(file):
        write_csv(file, *studies.as_table(rows))
    summaries = studies.summary(rows)
    err.print(f"all runs: {file}")
    if as_json:
        out.print_json(json.dumps(summaries))
        return
    from rich.table import Table

    table = Table("cost", box=None, pad_edge=False, title="largest |x2| of the last second (mm)")
    for column in ("runs", "configured", "best", "median", "worst", "< 1 mm", "< 5 mm"):
        table.add_column(column, justify="right")
    for name, facts in summaries.items():
        table.add_row(
            name,
            f"{facts['runs']:.0f}",
            *(f"{facts[f'{key}_mm']:.4f}" for key in ("configured", "best", "median", "worst")),
            *(f"{100.0 * facts[f'share_below_{key}_mm']:.0f} %" for key in (1, 5)),
        )
    out.print(table)

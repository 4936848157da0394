"""`klab bench`: measure this machine and the lab."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from koopman_lab.robots.dynamic import DYNAMIC
from koopman_lab.robots.kinematic import KINEMATIC
from offboard.bench.authentication_cost import authentication
from offboard.bench.dataset_time import dataset
from offboard.bench.fit_cost import edmd
from offboard.bench.flood import flood
from offboard.bench.lockstep_speed import lockstep
from offboard.bench.page_cost import view
from offboard.bench.parks import parks
from offboard.bench.soak.command import soak
from offboard.bench.start_time import start
from offboard.bench.stop import stop
from offboard.bench.stop_command import estop
from offboard.terminal import options
from offboard.terminal.choices import Commands
from offboard.terminal.needs import needs
from offboard.terminal.output import err, out, progress

app = Commands(help="Measure this machine and the lab.", no_args_is_help=True)
app.command()(lockstep)
app.command()(authentication)
app.command()(dataset)
app.command()(parks)
app.command()(edmd)
app.command()(view)
app.command()(stop)
app.command()(soak)
app.command()(flood)
app.command()(estop)
app.command()(start)


@app.callback()
def _group() -> None:
    """Keep the subcommands subcommands, however many there are."""


@app.command()
def realtime(
    config: options.ConfigFile = None,
    overrides: options.Overrides = None,
    robot: options.Robot = None,
    preset: options.Preset = options.PresetName.lab,
    minutes: Annotated[
        float, typer.Option("--minutes", min=0.05, help="How long to measure.")
    ] = 10.0,
    url: options.Url = None,
    folder: options.Out = None,
    as_json: options.AsJson = False,
) -> None:
    """Show how regularly the motor loop ticks in real time while a calibration drives the robot.

    Beside it ticks a process of the same priority that does nothing: the machine's own share.

    Example: klab bench realtime --minutes 2
    """
    from offboard.bench.driven_lab import MORE_THAN_ENOUGH, driven_lab
    from offboard.bench.tick_regularity import as_table, measure, stolen_s

    changes = [MORE_THAN_ENOUGH, *(overrides or ())]
    lab = options.resolve(config, changes, robot, preset, url=url)
    stolen_before_s = stolen_s()
    with driven_lab("realtime", lab, folder, minutes, "driving") as driven:
        pacings = measure(driven)
    stolen = None if stolen_before_s is None else (stolen_s() or 0.0) - stolen_before_s
    if as_json:
        rows = {name: row._asdict() for name, row in pacings.items()}
        out.print_json(json.dumps({"stolen_cpu_s": stolen} | rows))
        return
    out.print(as_table(pacings, lab.motor_loop.rate_hz))
    if stolen is not None:
        out.print(f"CPU time that a host took from this machine meanwhile: {stolen:.2f} s")


@app.command()
def logger(
    config: options.ConfigFile = None,
    overrides: options.Overrides = None,
    robot: options.Robot = None,
    minutes: Annotated[
        float, typer.Option("--minutes", min=0.05, help="How long to measure.")
    ] = 1.0,
    camera_rate_hz: Annotated[
        float, typer.Option("--camera-rate-hz", min=1.0, help="Ten times the usual one, or less.")
    ] = 2400.0,
    url: options.Url = None,
    folder: options.Out = None,
    as_json: options.AsJson = False,
) -> None:
    """Record a calibration with our logger and with lcm-logger at once, and count both.

    Example: klab bench logger --minutes 1 --camera-rate-hz 2400
    """
    from offboard.bench import logger_comparison
    from offboard.bench.driven_lab import MORE_THAN_ENOUGH, driven_lab

    changes = [MORE_THAN_ENOUGH, f"mocap.rate_hz={camera_rate_hz}", *(overrides or ())]
    lab = options.resolve(config, changes, robot, url=url)
    with driven_lab("logger", lab, folder, minutes, "recording") as driven:
        measured = logger_comparison.measure(driven)
    if as_json:
        out.print_json(json.dumps({name: row._asdict() for name, row in measured.items()}))
    else:
        out.print(logger_comparison.as_table(measured, camera_rate_hz, driven.seconds))


@app.command()
@needs("desk", "--out", lambda options: options["figure"])
def motor(
    config: options.ConfigFile = None,
    overrides: options.Overrides = None,
    preset: options.Preset = options.PresetName.lab,
    figure: Annotated[
        Path | None, typer.Option("--out", metavar="FILE", help="Draw FILE.pdf and FILE.png.")
    ] = None,
    as_json: options.AsJson = False,
) -> None:
    """Show step, ramp and disturbance responses of the motor loop.

    Example: klab bench motor --preset harsh --out runs/motor
    """
    from offboard.bench.motor_responses import as_table, figures_of_merit, responses

    kinematic = options.resolve(config, overrides, KINEMATIC.name, preset)
    dynamic = options.resolve(config, overrides, DYNAMIC.name, preset)
    curves = responses(kinematic, dynamic)
    merit = figures_of_merit(curves)
    if figure is not None:
        from koopman_lab.figures.motor_figure import draw_responses

        draw_responses(figure, curves)
        err.print(f"figure: {figure.with_suffix('.png')}")
    if as_json:
        out.print_json(json.dumps(merit))
    else:
        out.print(as_table(merit, preset.value))


@app.command()
@needs("desk")
def faults(
    config: options.ConfigFile = None,
    overrides: options.Overrides = None,
    robot: options.Robot = None,
    preset: options.Preset = options.PresetName.lab,
    only: Annotated[
        str, typer.Option("--only", metavar="WORDS", help="Only faults whose name has these words.")
    ] = "",
    as_json: options.AsJson = False,
) -> None:
    """Show for every fault what the robot does, how fast it stands, and what the operator reads.

    Example: klab bench faults --robot dynamic
    """
    from dataclasses import asdict

    from offboard.bench.faults.fault_rows import as_table, run_scenarios

    lab = options.resolve(config, overrides, robot, preset)
    with progress("trying", "faults") as report:
        rows = run_scenarios(lab, only, report)
    if as_json:
        out.print_json(json.dumps([asdict(row) for row in rows]))
    else:
        out.print(as_table(rows, lab.robot.kind))


@app.command()
@needs("desk")
def ocp(
    config: options.ConfigFile = None,
    overrides: options.Overrides = None,
    models: Annotated[
        list[Path] | None,
        typer.Option(
            "--model",
            metavar="FILE",
            help="Of either robot; default: both, from short sessions recorded in lockstep first.",
        ),
    ] = None,
    states: Annotated[
        int, typer.Option("--states", min=1, help="Length of the recorded sequence.")
    ] = 200,
    quick: Annotated[bool, typer.Option("--quick", help="30 states, to see that it runs.")] = False,
    as_json: options.AsJson = False,
) -> None:
    """Time our solver beside CasADi with IPOPT and do-mpc on the same states and guesses.

    Example: klab bench ocp --states 200
    """
    from dataclasses import asdict

    from offboard.bench import ocp_comparison
    from offboard.bench.ocp_solvers import has_do_mpc
    from offboard.bench.ocp_table import as_table, remarks
    from offboard.bench.tick_regularity import stolen_s

    stolen_before_s = stolen_s()
    rows: list[ocp_comparison.Row] = []
    with ocp_comparison.trained(models) as trained, progress("ocp") as report:
        for model in trained:
            lab = options.resolve(
                config, [f"controller.dt_s={model.dt_s}", *(overrides or ())], model.robot.name
            )
            count = min(states, ocp_comparison.QUICK) if quick else states
            for row in ocp_comparison.compare(lab, model, count):
                rows.append(row)
                what = f"{row.problem}, {row.model}, {row.solver}"
                report(len(rows), ocp_comparison.rows_of(trained), what)
    if not has_do_mpc():
        err.print("do-mpc is not installed and has no rows; pip install 'koopman-lab[bench]'")
    stolen = None if stolen_before_s is None else (stolen_s() or 0.0) - stolen_before_s
    if stolen is not None:
        err.print(f"CPU time that a host took from this machine meanwhile: {stolen:.2f} s")
    if as_json:
        out.print_json(json.dumps([asdict(row) for row in rows]))
        return
    out.print(as_table(rows))
    for line in remarks(rows):
        out.print(line)

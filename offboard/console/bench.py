"""`klab bench`: measure this machine and the lab."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from koopman_lab.config.schema import LabConfig
from koopman_lab.geometry import REST, Velocity
from offboard.console import options
from offboard.console.bench_dataset import dataset
from offboard.console.bench_edmd import edmd
from offboard.console.bench_parks import parks
from offboard.console.terminal import err, out, progress

if TYPE_CHECKING:
    import lcmtypes
    from koopman_lab.bus.lockstep import Lockstep
    from koopman_lab.bus.node import Port

app = typer.Typer(help="Measure this machine and the lab.", no_args_is_help=True)
app.command()(dataset)
app.command()(parks)
app.command()(edmd)

CHUNK_S = 1.0
WARM_UP_S = 2.0
LARGEST_A = 1.0
"""Of the weave, m/s^2."""
PARTS = {
    "onboard/plant/cameras": "cameras",
    "onboard/plant/node": "plant node",
    "onboard/plant": "motors, body, encoders",
    "onboard/motor_loop": "motor loop",
    "koopman_lab/bus": "runner",
    "lcmtypes": "encoding and decoding",
    "offboard": "commander",
}
"""Which part of the lab a source file belongs to; the first that fits counts."""


@app.callback()
def _group() -> None:
    """Keep the subcommands subcommands, however many there are."""


class Weaver:
    """Drives along a weave that never stands still, as the operator."""

    name = "weaver"
    operator = 3

    def __init__(self, config: LabConfig) -> None:
        self._config = config
        self._velocity = REST
        self.driving = False
        """Whether the motor loop last said that it drives."""

    def attach(self, port: Port) -> None:
        """Listen to the motor loop and set the control timer."""
        from koopman_lab.bus import channels
        from offboard.commander import Commands

        port.subscribe(channels.ONBOARD_STATUS, self._on_status)
        self._commands = Commands(port, self._config, self.operator)
        port.every(1.0 / self._config.controller.dt_s, self._on_tick)

    def close(self) -> None:
        """Nothing is held."""

    def _on_status(self, message: lcmtypes.onboard_status_t) -> None:
        self.driving = message.state == message.DRIVING

    def _on_tick(self, tick_us: int) -> None:
        seconds = tick_us * 1e-6
        wanted = Velocity(0.2 + 0.1 * math.sin(seconds), 0.8 * math.sin(0.7 * seconds))
        if self._config.robot.kind == "dynamic":
            dt_s, (v, omega) = self._config.controller.dt_s, self._velocity
            # From rest to the weave takes longer than one interval.
            a = max(-LARGEST_A, min(LARGEST_A, (wanted.v - v) / dt_s))
            self._velocity = Velocity(v + a * dt_s, wanted.omega)
            self._commands.send((a, (wanted.omega - omega) / dt_s), tick_us)
        else:
            self._commands.send(wanted, tick_us)


@app.command()
def lockstep(
    config: options.ConfigFile = None,
    overrides: options.Overrides = None,
    robot: options.Robot = None,
    preset: options.Preset = options.PresetName.lab,
    seconds: Annotated[
        float, typer.Option("--seconds", min=2.0, help="Virtual time to measure.")
    ] = 60.0,
    as_json: options.AsJson = False,
) -> None:
    """Show how much faster than real time plant and onboard loop run in lockstep, and on what.

    Example: klab bench lockstep --robot dynamic --seconds 60
    """
    lab_config = options.resolve(config, overrides, options.kind_of(robot), preset)
    lab, weaver = _lab(lab_config)
    factors = _factors(lab, seconds)
    shares = _shares(_lab(lab_config)[0], min(seconds, 20.0))
    facts = {
        "robot": lab_config.robot.kind,
        "preset": preset.value,
        "seconds": seconds,
        "driving": weaver.driving,
        "times_real_time": factors,
        "share": shares,
    }
    if as_json:
        out.print_json(json.dumps(facts))
        return
    from rich.table import Table

    out.print(
        f"{lab_config.robot.kind} robot, preset {preset.value}, {seconds:g} s of virtual time in "
        f"chunks of {CHUNK_S:g} s: {factors['median']:.0f} times real time "
        f"(99 % of the chunks at least {factors['p99']:.0f} times; by CPU time "
        f"{factors['cpu_median']:.0f} times)"
    )
    table = Table("part", title="where the time goes (profiled)")
    table.add_column("share", justify="right")
    for part, share in shares.items():
        table.add_row(part, f"{100.0 * share:.1f} %")
    out.print(table)


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
    from offboard.console.bench_realtime import as_table, measure, stolen_s
    from offboard.console.bench_session import MORE_THAN_ENOUGH
    from offboard.console.folder import new_folder
    from offboard.console.session import keeping_the_log

    wanted = [f"sampler.segments_per_basis={MORE_THAN_ENOUGH}", *(overrides or ())]
    lab = options.resolve(config, wanted, options.kind_of(robot), preset, url=url)
    listener = options.listen(lab)
    run = new_folder(folder, "realtime", lab)
    seconds, stolen_before_s = 60.0 * minutes, stolen_s()
    with keeping_the_log(run), progress("driving", "s") as report:
        found = measure(lab, run, listener, seconds, lambda s: report(round(s), round(seconds)))
    stolen = None if stolen_before_s is None else (stolen_s() or 0.0) - stolen_before_s
    if as_json:
        rows = {name: row._asdict() for name, row in found.items()}
        out.print_json(json.dumps({"stolen_cpu_s": stolen} | rows))
        return
    out.print(as_table(found, lab.motor_loop.rate_hz))
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
    from offboard.console import bench_logger
    from offboard.console.bench_session import MORE_THAN_ENOUGH
    from offboard.console.folder import new_folder
    from offboard.console.session import keeping_the_log

    wanted = [
        f"sampler.segments_per_basis={MORE_THAN_ENOUGH}",
        f"mocap.rate_hz={camera_rate_hz}",
        *(overrides or ()),
    ]
    lab = options.resolve(config, wanted, options.kind_of(robot), url=url)
    listener = options.listen(lab)
    run, seconds = new_folder(folder, "logger", lab), 60.0 * minutes
    with keeping_the_log(run), progress("recording", "s") as report:
        found = bench_logger.measure(
            lab, run, listener, seconds, lambda s: report(round(s), round(seconds))
        )
    if as_json:
        out.print_json(json.dumps({name: row._asdict() for name, row in found.items()}))
    else:
        out.print(bench_logger.as_table(found, camera_rate_hz, seconds))


@app.command()
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
    from offboard.console.bench_motor import as_table, figures_of_merit, responses

    kinematic = options.resolve(config, overrides, "kinematic", preset)
    dynamic = options.resolve(config, overrides, "dynamic", preset)
    found = responses(kinematic, dynamic)
    merit = figures_of_merit(found)
    if figure is not None:
        from koopman_lab.figures.motor import draw_responses

        draw_responses(figure, found)
        err.print(f"figure: {figure.with_suffix('.png')}")
    if as_json:
        out.print_json(json.dumps(merit))
    else:
        out.print(as_table(merit, preset.value))


@app.command()
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

    from offboard.console.bench_faults import as_table, suffer_all

    lab = options.resolve(config, overrides, options.kind_of(robot), preset)
    with progress("trying", "faults") as report:
        rows = suffer_all(lab, only, report)
    if as_json:
        out.print_json(json.dumps([asdict(row) for row in rows]))
    else:
        out.print(as_table(rows, lab.robot.kind))


@app.command()
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

    from offboard.console import bench_ocp
    from offboard.console.bench_realtime import stolen_s

    stolen_before_s = stolen_s()
    rows: list[bench_ocp.Row] = []
    with bench_ocp.trained(models) as trained, progress("ocp") as report:
        for model in trained:
            lab = options.resolve(
                config, [f"controller.dt_s={model.dt_s}", *(overrides or ())], model.robot_kind
            )
            count = min(states, bench_ocp.QUICK) if quick else states
            for row in bench_ocp.compare(lab, model, count):
                rows.append(row)
                what = f"{row.problem}, {row.model}, {row.solver}"
                report(len(rows), bench_ocp.rows_of(trained), what)
    if not bench_ocp.has_do_mpc():
        err.print("do-mpc is not installed and has no rows; pip install 'koopman-lab[bench]'")
    stolen = None if stolen_before_s is None else (stolen_s() or 0.0) - stolen_before_s
    if stolen is not None:
        err.print(f"CPU time that a host took from this machine meanwhile: {stolen:.2f} s")
    if as_json:
        out.print_json(json.dumps([asdict(row) for row in rows]))
        return
    out.print(bench_ocp.as_table(rows))
    for line in bench_ocp.remarks(rows):
        out.print(line)


def _lab(config: LabConfig) -> tuple[Lockstep, Weaver]:
    from koopman_lab.bus.lockstep import Lockstep
    from offboard.console import nodes

    lab, weaver = Lockstep(config), Weaver(config)
    for node in (nodes.plant(config), nodes.onboard(config), weaver):
        lab.add(node)
    lab.run(WARM_UP_S)
    return lab, weaver


def _factors(lab: Lockstep, seconds: float) -> dict[str, float]:
    """Return virtual over real time: the median, and what 99 % of the chunks reach."""
    import time

    import numpy as np

    wall, cpu = [], []
    for _ in range(round(seconds / CHUNK_S)):
        started, cpu_started = time.perf_counter(), time.process_time()
        lab.run(CHUNK_S)
        wall.append(CHUNK_S / (time.perf_counter() - started))
        cpu.append(CHUNK_S / (time.process_time() - cpu_started))
    lab.close()
    median, slow = np.percentile(wall, [50.0, 1.0]).tolist()
    return {"median": median, "p99": slow, "cpu_median": float(np.median(cpu))}


def _shares(lab: Lockstep, seconds: float) -> dict[str, float]:
    """Return each part's own time under the profiler, as a share of all, largest first."""
    import cProfile

    # Time in built-in functions counts for who calls them.
    profile = cProfile.Profile(builtins=False)
    profile.enable()
    lab.run(seconds)
    profile.disable()
    lab.close()
    times: dict[str, float] = {}
    entries: list[Any] = profile.getstats()
    for entry in entries:
        source = entry.code if isinstance(entry.code, str) else entry.code.co_filename
        part = _part(source)
        times[part] = times.get(part, 0.0) + entry.inlinetime
    total = sum(times.values())
    return {part: times[part] / total for part in sorted(times, key=lambda p: -times[p])}


def _part(source: str) -> str:
    path = Path(source).as_posix()
    return next((part for folder, part in PARTS.items() if f"/{folder}" in path), "other")

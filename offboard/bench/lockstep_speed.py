"""`klab bench lockstep`: how fast the lab runs on virtual time, and where the time goes."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from offboard.terminal import options
from offboard.terminal.output import out

if TYPE_CHECKING:
    from koopman_lab.bus.lockstep import Lockstep
    from koopman_lab.config.schema import LabConfig
    from offboard.bench.slalom import Slalom

CHUNK_S = 1.0
WARM_UP_S = 2.0
PARTS = {
    "onboard/plant/cameras": "cameras",
    "onboard/plant/robot": "plant node",
    "onboard/plant": "motors, body, encoders",
    "onboard/motor_loop": "motor loop",
    "koopman_lab/bus": "runner",
    "koopman_lab/emulation": "radio, board clock",
    "lcmtypes": "encoding and decoding",
    "offboard": "commander",
}
"""Which part of the lab a source file belongs to; the first that fits counts."""


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
    lab_config = options.resolve(config, overrides, robot, preset)
    lab, slalom = slalom_lab(lab_config)
    factors = _factors(lab, seconds)
    shares = _shares(slalom_lab(lab_config)[0], min(seconds, 20.0))
    facts = {
        "robot": lab_config.robot.kind,
        "preset": preset.value,
        "seconds": seconds,
        "driving": slalom.driving,
        "times_real_time": factors,
        "share": shares,
    }
    if as_json:
        out.print_json(json.dumps(facts))
        return
    from rich.table import Table

    out.print(
        f"{lab_config.robot.kind} robot, preset {preset.value}, {seconds:g} s of virtual time in "
        f"chunks of {CHUNK_S:g} s: {factors['median']:.0f} times real time, by CPU time "
        f"{factors['cpu_median']:.0f} times"
    )
    out.print(
        f"noise: the best chunk {factors['best']:.0f} times, 99 % of the chunks at least "
        f"{factors['p99']:.0f} times; all chunks do the same work, so the machine makes the rest"
    )
    table = Table("part", title="where the time goes (profiled)")
    table.add_column("share", justify="right")
    for part, share in shares.items():
        table.add_row(part, f"{100.0 * share:.1f} %")
    out.print(table)


def slalom_lab(config: LabConfig) -> tuple[Lockstep, Slalom]:
    """Return plant and motor loop in lockstep, and who drives the robot, past the start."""
    from koopman_lab.bus.lockstep import Lockstep
    from offboard.bench.slalom import Slalom
    from offboard.lab import nodes

    lab, slalom = Lockstep(config), Slalom(config)
    nodes.add_robot(lab, config)
    lab.add(slalom)
    lab.run(WARM_UP_S)
    return lab, slalom


def _factors(lab: Lockstep, seconds: float) -> dict[str, float]:
    """Return virtual over real time: the median, the best, and what 99 % of the chunks reach."""
    import time

    import numpy as np

    wall, cpu = [], []
    for _ in range(round(seconds / CHUNK_S)):
        started, cpu_started = time.perf_counter(), time.process_time()
        lab.run(CHUNK_S)
        wall.append(CHUNK_S / (time.perf_counter() - started))
        cpu.append(CHUNK_S / (time.process_time() - cpu_started))
    lab.close()
    slow, median, best = np.percentile(wall, [1.0, 50.0, 100.0]).tolist()
    cpu_median = float(np.median(cpu))
    return {"median": median, "best": best, "p99": slow, "cpu_median": cpu_median}


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

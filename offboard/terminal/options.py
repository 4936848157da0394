"""Options that several commands share, and what they make together: a configuration."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Sequence
from enum import Enum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from koopman_lab.config import presets
from koopman_lab.config.cost_table import COSTS
from koopman_lab.errors import ConfigError, DataError
from koopman_lab.geometry.planar import Pose, wrap_angle
from koopman_lab.robots.table import DEFAULT_ROBOT, ROBOTS
from offboard.terminal.choices import row_option

if TYPE_CHECKING:
    from koopman_lab.bus.realtime import Listener
    from koopman_lab.config.schema import LabConfig


class ShapeName(str, Enum):
    """Choices of ``--shape``."""

    infinity = "infinity"
    square = "square"


PresetName = presets.Preset
ConfigFile = Annotated[
    Path | None,
    typer.Option("--config", metavar="FILE", help="YAML file with any part of the configuration."),
]


def _completed_key(incomplete: str) -> list[tuple[str, str]]:
    """Return the keys that what is being typed may become, each with its default."""
    from koopman_lab.config.key_reference import leaves_of, unit_of
    from koopman_lab.config.load import load_config

    values = load_config().model_dump(mode="json")
    return [
        (f"{'.'.join(key)}=", f"{value} {unit_of(key)}".strip())
        for key, value in leaves_of(values)
        if ".".join(key).startswith(incomplete)
    ]


Overrides = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="KEY=VALUE",
        help="Override one key, e.g. controller.horizon=40; `klab config keys` lists them.",
        autocompletion=_completed_key,
    ),
]
Robot = Annotated[
    str | None,
    row_option("--robot", ROBOTS, f"Which robot ({DEFAULT_ROBOT}, unless --config says it)."),
]
RobotsName = Annotated[
    str | None,
    typer.Option(
        "--robot-name",
        metavar="NAME",
        help="Prefix of its channels (R1); robots with different names share a bus.",
    ),
]
AllRobots = Annotated[bool, typer.Option("--all", help="Every robot on the bus.")]
Preset = Annotated[
    PresetName,
    typer.Option(
        "--preset",
        help="What is simulated: real: nothing; lab: a robot a little off; harsh: three times as "
        "far off; ideal: the paper's equations.",
    ),
]
Seed = Annotated[int | None, typer.Option("--seed", min=0, help="Seed of draws and noise.")]
Url = Annotated[
    str | None, typer.Option("--url", help="LCM bus; default: LCM_DEFAULT_URL, then bus.url.")
]
ModelFile = Annotated[Path, typer.Option("--model", metavar="FILE", help="From `klab train`.")]
Cost = Annotated[str | None, row_option("--cost", COSTS, "Stage cost (paper, section 3.3).")]
Costs = Annotated[
    list[str] | None,
    row_option("--cost", COSTS, "Stage cost; several may be named."),
]
Start = Annotated[
    tuple[float, float, float] | None,
    typer.Option("--start", metavar="X Y THETA", help="m, m, degrees; default as the paper."),
]
Goal = Annotated[
    tuple[float, float, float],
    typer.Option("--goal", metavar="X Y THETA", help="Goal pose: m, m, degrees."),
]
ReferenceShape = Annotated[ShapeName, typer.Option("--shape", help="Shape of the runs.")]
Out = Annotated[
    Path | None,
    typer.Option("--out", metavar="DIR", help="Run folder; default runs/<stamp>-<what>."),
]
InLockstep = Annotated[
    bool, typer.Option("--lockstep", help="All in one process on virtual time, as fast as it goes.")
]
Window = Annotated[
    int | None,
    typer.Option("--window", min=1, help="Smoothing window of velocities, frames."),
]
SamplingTime = Annotated[
    float | None, typer.Option("--dt", metavar="S", help="Sampling time of the model, s.")
]
ModelsAndRuns = Annotated[
    list[Path],
    typer.Argument(
        metavar="MODEL... RUN...",
        help="Models (.npz, from `klab train`) and sessions of `klab reference`.",
    ),
]
Steps = Annotated[
    int, typer.Option("--steps", min=1, max=100, help="How many sampling times to predict.")
]
Dictionary = Annotated[
    str | None,
    typer.Option(
        "--dictionary",
        metavar="D",
        help="D5t, D6Eul, D7m, D8Eul, D10m, D13t, D12f, or expressions: '1, x1, x2, theta, ...'.",
    ),
]
Salvage = Annotated[
    bool, typer.Option("--salvage", help="Use every intact event of a damaged log.")
]
Lifeline = Annotated[int | None, typer.Option("--lifeline-fd", hidden=True)]
"""From a supervisor; see :func:`koopman_lab.bus.realtime.run_node`."""
AsJson = Annotated[bool, typer.Option("--json", help="Print JSON for scripts.")]


def resolve(
    config: Path | None,
    overrides: Sequence[str] | None,
    robot: str | None,
    preset: PresetName = PresetName.lab,
    seed: int | None = None,
    url: str | None = None,
    robot_name: str | None = None,
) -> LabConfig:
    """Return the configuration that a command's options ask for.

    Raises
    ------
    ConfigError
        If it is not valid.
    """
    from koopman_lab.config.load import load_config

    changes = list(overrides or ())
    if seed is not None:
        changes.append(f"seed={seed}")
    if robot_name is not None:
        changes.append(f"robot.name={robot_name}")
    if url is not None:
        changes.append(f"bus.url={url}")
    return load_config(
        config,
        robot=robot,
        preset=preset,
        bus_url=os.environ.get("LCM_DEFAULT_URL"),
        overrides=changes,
    )


def refuse_one_and_all(robot_name: str | None, *, all_robots: bool) -> None:
    """Refuse --robot-name beside --all.

    Raises
    ------
    ConfigError
        If both are there.
    """
    if all_robots and robot_name is not None:
        raise ConfigError(f"--all and --robot-name {robot_name}: all robots or one; drop one")


def listen(config: LabConfig, on_bad_key: Callable[[str], None] | None = None) -> Listener:
    """Open the bus, before a command leaves any trace on the disk.

    Raises
    ------
    BusError
        If it cannot be opened.
    ConfigError
        If the lab's key cannot be used, and nobody is told of it by ``on_bad_key``.
    """
    from koopman_lab.bus.realtime import Listener

    return Listener(config, on_bad_key)


def start_or_default(
    typed: tuple[float, float, float] | None, standard: tuple[float, float, float]
) -> Pose:
    """Return the pose that a person types (m, m, degrees), or else a standard one (m, m, rad)."""
    if typed is not None:
        return pose_from_typed(typed)
    x1, x2, theta = standard
    return Pose(x1, x2, wrap_angle(theta))


def pose_from_typed(typed: tuple[float, float, float]) -> Pose:
    """Return a pose (m, m, rad) from what a person types (m, m, degrees)."""
    x1, x2, theta_deg = typed
    return Pose(x1, x2, wrap_angle(math.radians(theta_deg)))


def parse_windows(text: str) -> list[int]:
    """Return the windows that a person typed.

    Raises
    ------
    DataError
        If they are no whole numbers above 0.
    """
    try:
        windows = [int(item) for item in text.split(",")]
    except ValueError:
        windows = [0]
    if min(windows) < 1:
        raise DataError(
            f"--windows {text}: whole numbers of frames from 1 on, with commas between them, "
            "for example --windows 1,10,40"
        )
    return windows


def parse_factors(text: str) -> list[float]:
    """Return the factors that a person typed.

    Raises
    ------
    DataError
        If they are no numbers above 0, or 1 is not among them.
    """
    try:
        factors = [float(item) for item in text.split(",")]
    except ValueError:
        factors = []
    if 1.0 not in factors or not all(0.0 < factor < math.inf for factor in factors):
        raise DataError(
            f"--factors {text}: numbers above 0 with commas between them, 1 among them, "
            "for example --factors 0.1,1,10"
        )
    return factors

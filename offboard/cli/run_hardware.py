"""`klab run driver` and `klab run mocap`: real motors and real cameras, each by its name."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

from koopman_lab.bus.hardware import CAMERAS, DRIVERS
from offboard.terminal import options
from offboard.terminal.choices import row_option

if TYPE_CHECKING:
    from koopman_lab.config.schema import LabConfig


def driver(
    name: Annotated[str, row_option("--driver", DRIVERS, "Of which motors.")],
    config: options.ConfigFile = None,
    overrides: options.Overrides = None,
    robot: options.Robot = None,
    preset: options.Preset = options.PresetName.lab,
    robot_name: options.RobotsName = None,
    url: options.Url = None,
    lifeline_fd: options.Lifeline = None,
) -> None:
    """Obey motor commands and say what the encoders count, in place of the plant.

    Example: klab run driver --driver plant --robot dynamic
    """
    lab = options.resolve(config, overrides, robot, preset, url=url, robot_name=robot_name)
    _run("driver", name, lab, lifeline_fd)


def mocap(
    name: Annotated[str, row_option("--driver", CAMERAS, "Of which cameras.")],
    config: options.ConfigFile = None,
    overrides: options.Overrides = None,
    robot: options.Robot = None,
    preset: options.Preset = options.PresetName.lab,
    robot_name: options.RobotsName = None,
    url: options.Url = None,
    lifeline_fd: options.Lifeline = None,
) -> None:
    """Say where cameras see the robot, in place of those of the plant.

    The plant's own, `--driver plant`, see whom `klab run driver --driver plant` moves.

    Example: klab run mocap --driver plant
    """
    lab = options.resolve(config, overrides, robot, preset, url=url, robot_name=robot_name)
    _run("mocap", name, lab, lifeline_fd)


def _run(process: str, name: str, lab: LabConfig, lifeline_fd: int | None) -> None:
    from koopman_lab.bus.processes import PROCESSES
    from koopman_lab.bus.realtime import run_node

    make = PROCESSES.load(process, PROCESSES.get(process).factory)
    run_node(make(name, lab), lab, lifeline_fd=lifeline_fd)

"""`klab config`: check and show the configuration that files and options make."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Annotated, Any

import typer

from koopman_lab.config.load import dump_config
from koopman_lab.config.schema import LabConfig
from offboard.terminal import options
from offboard.terminal.choices import Commands
from offboard.terminal.output import out

ABSENT = "nothing"

app = Commands(help="Check and show configurations.", no_args_is_help=True)

File = Annotated[
    Path | None,
    typer.Argument(metavar="FILE", help="YAML file with any part of the configuration."),
]


@app.command()
def check(
    file: File = None,
    overrides: options.Overrides = None,
    robot: options.Robot = None,
    preset: options.Preset = options.PresetName.lab,
) -> None:
    """Say whether a configuration can be used: what it is of, and what is not as by default.

    Otherwise each mistake with its file, line and key, what is allowed, and the nearest key; then
    the exit code is 2.

    Example: klab config check runs/robot.yaml --preset real
    """
    config = options.resolve(file, overrides, robot, preset)
    usual = options.resolve(None, None, config.robot.kind, preset)
    rows = list(differences(usual, config))
    simulated = "nothing simulated" if config.simulation is None else "simulated"
    out.print(
        f"{file or 'configuration'}: ok; {config.robot.kind} robot {config.robot.name}, preset "
        f"{preset.value}, {simulated}; {len(rows) or 'no'} "
        f"{'value differs' if len(rows) == 1 else 'values differ'} from the defaults"
    )
    for key, value, default in rows:
        out.print(f"  {key}: {value} (default {default})")


@app.command()
def show(
    file: File = None,
    overrides: options.Overrides = None,
    robot: options.Robot = None,
    preset: options.Preset = options.PresetName.lab,
) -> None:
    """Print the whole configuration as YAML, as a run folder keeps it.

    Example: klab config show --preset real --set robot.name=R2
    """
    out.print(dump_config(options.resolve(file, overrides, robot, preset)), end="")


def differences(usual: LabConfig, config: LabConfig) -> Iterator[tuple[str, Any, Any]]:
    """Yield the dotted key of each value that differs, the value, and that of ``usual``."""
    values, defaults = (dict(_leaves(c.model_dump(mode="json"))) for c in (config, usual))
    for key in dict.fromkeys((*values, *defaults)):
        value, default = values.get(key, ABSENT), defaults.get(key, ABSENT)
        if value != default:
            yield key, value, default


def _leaves(values: Mapping[str, Any], above: str = "") -> Iterator[tuple[str, Any]]:
    for key, value in values.items():
        if isinstance(value, Mapping):
            yield from _leaves(value, f"{above}{key}.")
        else:
            yield above + key, value

"""`klab config`: show, explain and check the configuration that files and options make."""

from __future__ import annotations

import json
import os
import textwrap
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from offboard.terminal import options
from offboard.terminal.choices import Commands
from offboard.terminal.output import out

if TYPE_CHECKING:
    from koopman_lab.config.key_reference import KeyFacts
    from koopman_lab.config.schema import LabConfig

app = Commands(help="Show, explain and check configurations.", no_args_is_help=True)

File = Annotated[
    Path | None,
    typer.Argument(metavar="FILE", help="YAML file with any part of the configuration."),
]


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
    from koopman_lab.config.load import dump_config

    out.print(dump_config(options.resolve(file, overrides, robot, preset)), end="")


@app.command()
def keys(
    file: File = None,
    only: Annotated[
        str, typer.Option("--only", metavar="WORD", help="Only keys that have this in their name.")
    ] = "",
    overrides: options.Overrides = None,
    robot: options.Robot = None,
    preset: options.Preset = options.PresetName.lab,
    as_json: options.AsJson = False,
) -> None:
    """List every key: value, unit, default where it is another, and who says so and why.

    Each can be set in a file, or by --set KEY=VALUE, whose keys the shell completes.

    Example: klab config keys --only horizon --robot dynamic
    """
    from koopman_lab.config.key_reference import key_facts
    from koopman_lab.config.layering import layers_of
    from koopman_lab.errors import ConfigError

    config = options.resolve(file, overrides, robot, preset)
    usual = options.resolve(None, None, config.robot.kind, preset)
    layers = layers_of(
        file,
        robot=robot,
        preset=preset,
        bus_url=os.environ.get("LCM_DEFAULT_URL"),
        overrides=overrides or (),
    )
    values, defaults = (c.model_dump(mode="json") for c in (config, usual))
    facts = [f for f in key_facts(values, defaults, layers) if only in f.key]
    if not facts:
        raise ConfigError(f"--only {only}: no key has this in its name; `klab config keys` has all")
    if as_json:
        out.print_json(json.dumps([fact._asdict() for fact in facts]))
        return
    for fact in facts:
        _print(fact)


def _print(fact: KeyFacts) -> None:
    value, default = (_in_yaml(value) for value in (fact.value, fact.default))
    usual = "" if value == default else f" (default {default})"
    out.print(f"{fact.key}: {value}{f' {fact.unit}' if fact.unit else ''}{usual}")
    reason = f"{fact.reason} ({fact.place})" if fact.reason else fact.place
    width = max(out.width, 30)
    for line in textwrap.wrap(
        reason, width, initial_indent="    ", subsequent_indent="    ", break_on_hyphens=False
    ):
        out.print(line)


def _in_yaml(value: Any) -> str:
    return "null" if value is None else json.dumps(value) if isinstance(value, bool) else str(value)


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
    from koopman_lab.bus.bus_url import parse_bus_url

    config = options.resolve(file, overrides, robot, preset)
    parse_bus_url(config.bus.url)
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


def differences(usual: LabConfig, config: LabConfig) -> Iterator[tuple[str, Any, Any]]:
    """Yield the dotted key of each value that differs, the value, and that of ``usual``."""
    from koopman_lab.config.key_reference import NOTHING, leaves_of

    values, defaults = (dict(leaves_of(c.model_dump(mode="json"))) for c in (config, usual))
    for key in dict.fromkeys((*values, *defaults)):
        value, default = values.get(key, NOTHING), defaults.get(key, NOTHING)
        if value != default:
            yield ".".join(key), value, default

"""From YAML files and ``--set`` overrides to a validated :class:`LabConfig`.

Layers, later ones winning key by key: the defaults of all robots, those of the robot's kind, the
preset, what the preset changes for the kind, the user's file, the overrides, settings in Python.
"""

from __future__ import annotations

import difflib
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, get_args

import yaml
from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

from koopman_lab.config.bounds import OUT_OF_BOUNDS
from koopman_lab.config.layer import Layer, merge, parse_layer, settings_layer
from koopman_lab.config.layering import known_robot, layers_of, locate, merged, robot_kind
from koopman_lab.config.moved_keys import translate
from koopman_lab.config.presets import Preset
from koopman_lab.config.robot_defaults import default_layer, robot_layer
from koopman_lab.config.robot_fit import RobotMisfitError
from koopman_lab.config.schema import LabConfig
from koopman_lab.config.yaml_text import Key, read_text
from koopman_lab.errors import ConfigError


def load_config(
    file: Path | str | None = None,
    *,
    robot: str | None = None,
    preset: str = Preset.lab,
    bus_url: str | None = None,
    overrides: Sequence[str] = (),
    settings: Mapping[str, Any] | None = None,
) -> LabConfig:
    """Return the configuration of a lab.

    Parameters
    ----------
    file
        A YAML file with any part of the configuration.
    robot
        The robot's kind; the file may say it instead (``robot.kind``).
    preset
        What is simulated, a :class:`~koopman_lab.config.presets.Preset`.
    bus_url
        In place of the default ``bus.url``; the file and the overrides stand above it.
    overrides
        ``section.key=value`` with a YAML value each, for example ``controller.horizon=40``.
    settings
        Values above all others, as Python has them: ``{"controller": {"horizon": 40}}``.

    Raises
    ------
    ConfigError
        If something cannot be read or is not allowed; the message names file, line, key, what is
        allowed and the nearest valid key, or where a key of an older version is now.
    PluginError
        If the robot is another package's, and cannot be used.
    """
    path = None if file is None else Path(file)
    layers = layers_of(
        path, robot=robot, preset=preset, bus_url=bus_url, overrides=overrides, settings=settings
    )
    try:
        config = LabConfig.model_validate(merged(layers))
    except ValidationError as error:
        raise ConfigError(_error_text(error.errors(), layers)) from None
    return config


def with_settings(config: LabConfig, settings: Mapping[str, Any]) -> LabConfig:
    """Return a configuration with other values, as far as they are allowed.

    Parameters
    ----------
    config
        The configuration.
    settings
        As for :func:`load_config`.

    Raises
    ------
    ConfigError
        If a value is not allowed; see :func:`load_config`.
    """
    layers = [
        Layer("the configuration", config.model_dump(mode="json"), {}),
        settings_layer(settings),
    ]
    try:
        return LabConfig.model_validate(merged(layers))
    except ValidationError as error:
        raise ConfigError(_error_text(error.errors(), layers)) from None


def dump_config(config: LabConfig) -> str:
    """Return the whole configuration as YAML; :func:`load_config` reads it back unchanged."""
    return yaml.safe_dump(config.model_dump(mode="json"), sort_keys=False)


def parse_config(text: str, source: str) -> LabConfig:
    """Return a whole configuration from text that :func:`dump_config` wrote.

    Keys that an older version had elsewhere are understood; those that it did not have yet take
    their defaults.

    Raises
    ------
    ConfigError
        If the text is no valid configuration of a robot; ``source`` says where it came from.
    PluginError
        If the robot is another package's, and cannot be used.
    """
    recorded = parse_layer(text, source)
    kind = robot_kind([recorded])
    values = translate(recorded.values)
    if kind is not None:
        for layer in (robot_layer(known_robot(kind, [recorded])), default_layer("base")):
            values = merge(layer.values, values)
    try:
        return LabConfig.model_validate(values)
    except ValidationError as error:
        raise ConfigError(_error_text(error.errors(), [recorded])) from None


def read_record(file: Path) -> LabConfig:
    """Read the configuration that a run, perhaps of an older version, has left in its folder.

    Raises
    ------
    ConfigError
        If there is no such file, or it holds none.
    PluginError
        If the robot is another package's, and cannot be used.
    """
    return parse_config(read_text(file), str(file))


def _error_text(errors: Sequence[ErrorDetails], layers: Sequence[Layer]) -> str:
    lines = []
    if any(error["type"] == "missing" and error["loc"][0] == "simulation" for error in errors):
        # Of the presets one says nothing of it, which is the only way to a part of it.
        lines.append(
            f"{locate(('simulation',), layers)}: simulation: set in part, but this preset "
            f"simulates nothing; drop it, or take --preset {Preset.lab.value}"
        )
        errors = [error for error in errors if error["loc"][:1] != ("simulation",)]
    for error in errors:
        key = tuple(str(part) for part in error["loc"] if part != "[key]")
        misfit = error.get("ctx", {}).get("error")
        if isinstance(misfit, RobotMisfitError):
            lines.append(f"{locate(misfit.key, layers)}: {misfit}")
            continue
        where, dotted = locate(key, layers), ".".join(key)
        if error["type"] == "extra_forbidden":
            similar = _nearest(key)
            hint = f"; did you mean {similar}?" if similar else ""
            lines.append(f"{where}: {dotted}: unknown key{hint}")
        else:
            reason = error["msg"].removeprefix("Value error, ")
            reason = reason[:1].lower() + reason[1:]
            no_value = error["type"] in ("missing", OUT_OF_BOUNDS) or not key
            found_text = "" if no_value else f", found {error['input']!r}"
            lines.append(f"{where}: {dotted + ': ' if dotted else ''}{reason}{found_text}")
    return "\n".join(lines)


def _nearest(key: Key) -> str | None:
    """Return the most similar valid key: first among its siblings, then anywhere."""
    known = list(_known_keys(LabConfig, ()))
    siblings = {".".join(k): k for k in known if k[:-1] == key[:-1]}
    names = difflib.get_close_matches(key[-1], [k[-1] for k in siblings.values()], n=1, cutoff=0.6)
    if names:
        return ".".join((*key[:-1], names[0]))
    dotted = [".".join(k) for k in known]
    elsewhere = [name for name in dotted if name.rpartition(".")[2] == key[-1]]
    matches = elsewhere or difflib.get_close_matches(".".join(key), dotted, n=1, cutoff=0.6)
    return matches[0] if matches else None


def _known_keys(model: type[BaseModel], above: Key) -> Iterator[Key]:
    for name, field in model.model_fields.items():
        yield (*above, name)
        for section in (field.annotation, *get_args(field.annotation)):
            if isinstance(section, type) and issubclass(section, BaseModel):
                yield from _known_keys(section, (*above, name))

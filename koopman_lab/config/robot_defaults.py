"""Default values of a configuration: of all robots, of a preset, of a kind of robot."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from importlib import resources
from typing import Any

from koopman_lab.config.layer import Layer, merge, parse_layer
from koopman_lab.errors import ConfigError
from koopman_lab.robots.robot_type import RobotType

PRESETS = "presets"
"""Section of a kind's file: what a preset changes for this kind alone."""


@cache
def default_layer(name: str) -> Layer:
    """Return one of our own files: ``base``, or a preset's."""
    folder = resources.files("koopman_lab.config") / "defaults"
    text = (folder / f"{name}.yaml").read_text(encoding="utf-8")
    return parse_layer(text, f"defaults/{name}.yaml")


def robot_layer(robot: RobotType) -> Layer:
    """Return what a lab of a kind takes where it says nothing.

    Raises
    ------
    ConfigError
        If the kind's file cannot be read.
    """
    layer = _defaults_of(robot)
    values = {key: value for key, value in layer.values.items() if key != PRESETS}
    return Layer(layer.source, merge(values, {"robot": {"kind": robot.name}}), layer.lines)


def robot_preset_layer(robot: RobotType, preset: str) -> Layer:
    """Return what a preset changes for a kind alone.

    Raises
    ------
    ConfigError
        If the kind's file cannot be read.
    """
    layer, above = _defaults_of(robot), (PRESETS, preset)
    values: Any = layer.values
    for key in above:
        values = values.get(key) or {}
        if not isinstance(values, Mapping):
            where = layer.locate(above) or layer.source
            raise ConfigError(f"{where}: {'.'.join(above)}: expected sections of a configuration")
    lines = {key[2:]: line for key, line in layer.lines.items() if key[:2] == above and key[2:]}
    return Layer(layer.source, dict(values), lines)


def _defaults_of(robot: RobotType) -> Layer:
    file = robot.defaults
    if file is None:
        return Layer(f"the {robot.name} robot", {}, {})
    try:
        return _cached_layer(file.read_text(encoding="utf-8"), str(file))
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigError(
            f"{file}: the defaults of the {robot.name} robot cannot be read ({error}); mend its "
            "description"
        ) from None


@cache
def _cached_layer(text: str, source: str) -> Layer:
    return parse_layer(text, source)

"""The layers of a configuration: from which files and overrides its values come, unvalidated.

Apart from the schema, which takes longer to load than whoever stops a robot can wait.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from koopman_lab.config.layer import Layer, merge, override_layer, read_layer, settings_layer
from koopman_lab.config.moved_keys import moved
from koopman_lab.config.presets import Preset
from koopman_lab.config.robot_defaults import default_layer, robot_layer, robot_preset_layer
from koopman_lab.config.yaml_text import Key
from koopman_lab.errors import ConfigError
from koopman_lab.robots.robot_type import RobotType
from koopman_lab.robots.table import DEFAULT_ROBOT, robot_type


def layers_of(
    file: Path | None = None,
    *,
    robot: str | None = None,
    preset: str = Preset.lab,
    bus_url: str | None = None,
    overrides: Sequence[str] = (),
    settings: Mapping[str, Any] | None = None,
) -> list[Layer]:
    """Return the layers of a configuration, later ones winning key by key.

    Parameters and errors are those of :func:`koopman_lab.config.load.load_config`, as far as
    values need not be looked at for them.
    """
    user = [read_layer(file)] if file else []
    user += [override_layer(text) for text in overrides]
    user += [settings_layer(settings)] if settings else []
    configured_kind = robot_kind(user)
    if robot and configured_kind and robot != configured_kind:
        where = locate(("robot", "kind"), user)
        raise ConfigError(
            f"{where}: robot.kind is {configured_kind}, but --robot says {robot}; drop one"
        )
    kind = (
        known_robot(configured_kind, user)
        if configured_kind
        else robot_type(robot or DEFAULT_ROBOT)
    )
    layers = [default_layer("base"), robot_layer(kind)]
    if preset != Preset.lab:
        name = Preset(preset).value
        layers += [default_layer(name), robot_preset_layer(kind, name)]
    if bus_url:
        values = {"bus": {"url": bus_url}}
        layers.append(Layer("LCM_DEFAULT_URL", values, {("bus",): 0, ("bus", "url"): 0}))
    layers += user
    _require_present_keys(layers)
    return layers


def merged(layers: Sequence[Layer]) -> dict[str, Any]:
    """Return the values of layers laid one over the other."""
    values: dict[str, Any] = {}
    for layer in layers:
        values = merge(values, layer.values)
    return values


def _require_present_keys(layers: Sequence[Layer]) -> None:
    """Refuse keys of older versions: who writes one must know what it means today."""
    lines = [
        f"{layer.locate(old)}: {'.'.join(old)}: is now {'.'.join(new)}"
        for layer in layers
        for old, new in moved(layer.values)
    ]
    if lines:
        raise ConfigError("\n".join(lines))


def robot_kind(layers: Sequence[Layer]) -> str | None:
    """Return the robot's kind that layers say, None if they say none."""
    for layer in reversed(layers):
        section = layer.values.get("robot")
        kind = section.get("kind") if isinstance(section, Mapping) else None
        if isinstance(kind, str):
            return kind
    return None


def known_robot(kind: str, layers: Sequence[Layer]) -> RobotType:
    """Return the robot of a kind.

    Raises
    ------
    ConfigError
        If there is none; the message names where the kind stands.
    PluginError
        If it is another package's, and cannot be used.
    """
    try:
        return robot_type(kind)
    except ConfigError as error:
        where = locate(("robot", "kind"), layers)
        raise ConfigError(f"{where}: robot.kind: {error}") from None


def locate(key: Key, layers: Sequence[Layer]) -> str:
    """Return where a key stands, as ``file:line`` where that is known."""
    for layer in reversed(layers):
        where = layer.locate(key)
        if where:
            return where
    return layers[0].source if len(layers) == 1 else "configuration"

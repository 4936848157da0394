"""From YAML files and ``--set`` overrides to a validated :class:`LabConfig`.

Layers, later ones winning key by key: the defaults of both robots, those of the robot's kind, the
plant preset, the user's file, the overrides.
"""

from __future__ import annotations

import difflib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from importlib import resources
from pathlib import Path
from typing import Any, Literal, get_args

import yaml
from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

from koopman_lab.config.schema import LabConfig
from koopman_lab.config.values import RobotKind
from koopman_lab.errors import ConfigError

LOADER: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
"""As safe either way; that in C, where PyYAML was built with it, takes a tenth of the time."""

Preset = Literal["lab", "ideal", "harsh"]
Key = tuple[str, ...]


@dataclass(frozen=True)
class Layer:
    """Values from one source, and the line of each key where the source is a file."""

    source: str
    values: dict[str, Any]
    lines: Mapping[Key, int]

    def locate(self, key: Key) -> str | None:
        """Return ``file:line`` if this layer sets ``key`` or, failing that, something above it."""
        while key:
            if key in self.lines:
                line = self.lines[key]
                return f"{self.source}:{line}" if line else self.source
            key = key[:-1]
        return None


def load_config(
    file: Path | None = None,
    *,
    robot: RobotKind | None = None,
    preset: Preset = "lab",
    bus_url: str | None = None,
    overrides: Sequence[str] = (),
) -> LabConfig:
    """Return the configuration of a lab.

    Parameters
    ----------
    file
        A YAML file with any part of the configuration.
    robot
        The robot's kind; the file may say it instead (``robot.kind``).
    preset
        Which plant stands in for hardware.
    bus_url
        In place of the default ``bus.url``; the file and the overrides stand above it.
    overrides
        ``section.key=value`` with a YAML value each, for example ``controller.horizon=40``.

    Raises
    ------
    ConfigError
        If something cannot be read or is not allowed; the message names file, line, key, what is
        allowed and the nearest valid key.
    """
    user = [read_layer(file)] if file else []
    user += [_override(text) for text in overrides]
    values: dict[str, Any]
    said = _robot_kind(user)
    if robot and said and robot != said:
        where = _locate(("robot", "kind"), user)
        raise ConfigError(f"{where}: robot.kind is {said}, but --robot says {robot}; drop one")
    kind = robot or said or "kinematic"
    layers = [_default("base"), _default(kind)]
    if preset == "ideal":
        layers += [_default("ideal"), _default(f"ideal_{kind}")]
    elif preset == "harsh":
        layers.append(_default("harsh"))
    if bus_url:
        values = {"bus": {"url": bus_url}}
        layers.append(Layer("LCM_DEFAULT_URL", values, {("bus",): 0, ("bus", "url"): 0}))
    layers += user
    values = {}
    for layer in layers:
        values = merge(values, layer.values)
    try:
        config = LabConfig.model_validate(values)
    except ValidationError as error:
        raise ConfigError(_explain(error.errors(), layers)) from None
    return config


def dump_config(config: LabConfig) -> str:
    """Return the whole configuration as YAML; :func:`load_config` reads it back unchanged."""
    return yaml.safe_dump(config.model_dump(mode="json"), sort_keys=False)


def parse_config(text: str, source: str) -> LabConfig:
    """Return a whole configuration from text that :func:`dump_config` wrote.

    Keys that an older version did not have yet take their defaults.

    Raises
    ------
    ConfigError
        If the text is no valid configuration of a robot; ``source`` says where it came from.
    """
    said = _parse(text, source)
    kind = _robot_kind([said])
    values = said.values
    if kind is not None:
        for name in (kind, "base"):
            values = merge(_default(name).values, values)
    try:
        return LabConfig.model_validate(values)
    except ValidationError as error:
        raise ConfigError(_explain(error.errors(), [said])) from None


def merge(below: Mapping[str, Any], above: Mapping[str, Any]) -> dict[str, Any]:
    """Return ``below`` with ``above`` laid over it, section by section."""
    merged = dict(below)
    for key, value in above.items():
        old = merged.get(key)
        both = isinstance(old, Mapping) and isinstance(value, Mapping)
        merged[key] = merge(old, value) if both else value  # type: ignore[arg-type]
    return merged


def read_layer(file: Path) -> Layer:
    """Read one YAML file.

    Raises
    ------
    ConfigError
        If there is no such file or it is not a YAML mapping.
    """
    try:
        text = file.read_text(encoding="utf-8")
    except FileNotFoundError:
        raise ConfigError(f"{file}: no such configuration file") from None
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigError(f"{file}: cannot be read as a configuration: {error}") from None
    return _parse(text, str(file))


def _parse(text: str, source: str) -> Layer:
    try:
        loader = LOADER(text)
        try:
            root = loader.get_single_node()
            values = None if root is None else loader.construct_document(root)
        finally:
            loader.dispose()
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        where = f"{source}:{mark.line + 1}" if mark else source
        reason = getattr(error, "problem", None) or str(error)
        raise ConfigError(f"{where}: not valid YAML: {reason}") from None
    if values is None:
        return Layer(source, {}, {})
    if not isinstance(values, dict):
        raise ConfigError(
            f"{source}:1: expected sections such as 'controller:', found a single value"
        )
    return Layer(source, values, dict(_lines(root, ())))


def _lines(node: yaml.Node | None, above: Key) -> Iterator[tuple[Key, int]]:
    if isinstance(node, yaml.MappingNode):
        for key_node, value_node in node.value:
            key = (*above, str(key_node.value))
            yield key, key_node.start_mark.line + 1
            yield from _lines(value_node, key)
    elif isinstance(node, yaml.SequenceNode):
        for index, item in enumerate(node.value):
            key = (*above, str(index))
            yield key, item.start_mark.line + 1
            yield from _lines(item, key)


def _override(text: str) -> Layer:
    dotted, equals, value_text = text.partition("=")
    key = tuple(part.strip() for part in dotted.split("."))
    if not equals or not all(key):
        raise ConfigError(f"--set {text}: expected section.key=value, e.g. controller.horizon=40")
    try:
        value = yaml.safe_load(value_text)
    except yaml.YAMLError:
        raise ConfigError(f"--set {text}: {value_text!r} is not a YAML value") from None
    for part in reversed(key):
        value = {part: value}
    lines = {key[: i + 1]: 0 for i in range(len(key))}
    return Layer(f"--set {text}", value, lines)


@cache
def _default(name: str) -> Layer:
    folder = resources.files("koopman_lab.config") / "defaults"
    return _parse((folder / f"{name}.yaml").read_text(encoding="utf-8"), f"defaults/{name}.yaml")


def _robot_kind(layers: Sequence[Layer]) -> RobotKind | None:
    for layer in reversed(layers):
        section = layer.values.get("robot")
        kind = section.get("kind") if isinstance(section, Mapping) else None
        for known in get_args(RobotKind):
            if kind == known:
                return known  # type: ignore[no-any-return]
    return None


def _locate(key: Key, layers: Sequence[Layer]) -> str:
    for layer in reversed(layers):
        where = layer.locate(key)
        if where:
            return where
    return layers[0].source if len(layers) == 1 else "configuration"


def _explain(errors: Sequence[ErrorDetails], layers: Sequence[Layer]) -> str:
    lines = []
    for error in errors:
        key = tuple(str(part) for part in error["loc"] if part != "[key]")
        where, dotted = _locate(key, layers), ".".join(key)
        if error["type"] == "extra_forbidden":
            near = _nearest(key)
            hint = f"; did you mean {near}?" if near else ""
            lines.append(f"{where}: {dotted}: unknown key{hint}")
        else:
            reason = error["msg"].removeprefix("Value error, ")
            reason = reason[0].lower() + reason[1:]
            no_value = error["type"] == "missing" or not key
            found = "" if no_value else f", found {error['input']!r}"
            lines.append(f"{where}: {dotted + ': ' if dotted else ''}{reason}{found}")
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
        if isinstance(field.annotation, type) and issubclass(field.annotation, BaseModel):
            yield from _known_keys(field.annotation, (*above, name))

"""Values from one source of a configuration, with the line of each key."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from koopman_lab.errors import ConfigError

LOADER: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
"""The safe loader; that in C, where PyYAML was built with it, takes a tenth of the time."""

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
    return parse_layer(read_text(file), str(file))


def read_text(file: Path) -> str:
    """Read the text of one file.

    Raises
    ------
    ConfigError
        If there is no such file, or it is no text.
    """
    try:
        return file.read_text(encoding="utf-8")
    except FileNotFoundError:
        raise ConfigError(f"{file}: no such configuration file") from None
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigError(f"{file}: cannot be read as a configuration: {error}") from None


def parse_layer(text: str, source: str) -> Layer:
    """Return what a YAML text says; ``source`` says where it came from.

    Raises
    ------
    ConfigError
        If it is not a YAML mapping.
    """
    try:
        loader = LOADER(text)
        try:
            root = loader.get_single_node()
            values = None if root is None else loader.construct_document(root)
        finally:
            loader.dispose()
    except (yaml.YAMLError, ValueError, RecursionError) as error:
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


def override_layer(text: str) -> Layer:
    """Return what one ``--set section.key=value`` says.

    Raises
    ------
    ConfigError
        If it is not of this form.
    """
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

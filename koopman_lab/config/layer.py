"""Values from one source of a configuration, with the line of each key."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from koopman_lab.config.yaml_text import Key, parse_yaml, read_text
from koopman_lab.errors import ConfigError


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
        If there is no such file, or it is not a YAML mapping.
    """
    return parse_layer(read_text(file), str(file))


def parse_layer(text: str, source: str) -> Layer:
    """Return what a YAML text says; ``source`` says where it came from.

    Raises
    ------
    ConfigError
        If it is not a YAML mapping, or one that :func:`~koopman_lab.config.yaml_text.parse_yaml`
        refuses.
    """
    values, lines = parse_yaml(text, source)
    if values is None:
        return Layer(source, {}, {})
    if not isinstance(values, dict):
        raise ConfigError(
            f"{source}:1: expected sections such as 'controller:', found a single value"
        )
    return Layer(source, values, lines)


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
    value = parse_yaml(value_text, f"--set {text}").value
    for part in reversed(key):
        value = {part: value}
    lines = {key[: i + 1]: 0 for i in range(len(key))}
    return Layer(f"--set {text}", value, lines)


def settings_layer(settings: Mapping[str, Any]) -> Layer:
    """Return what settings in Python say: values by section and key.

    Numbers and arrays of NumPy, and tuples, count as what YAML has in their place.
    """
    values = {section: _plain(part) for section, part in settings.items()}
    return Layer("settings", values, dict.fromkeys(_keys(values, ()), 0))


def _plain(value: Any) -> Any:
    if hasattr(value, "tolist"):  # NumPy's, which need not be loaded to ask
        return value.tolist()
    if isinstance(value, Mapping):
        return {key: _plain(part) for key, part in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(part) for part in value]
    return value


def _keys(values: Mapping[str, Any], above: Key) -> Iterator[Key]:
    for name, value in values.items():
        yield (*above, name)
        if isinstance(value, Mapping):
            yield from _keys(value, (*above, name))

"""The fields of LCM messages as plain values, for JSON and tables."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from typing import Any


def plain_values(message: Any) -> dict[str, Any]:
    """Return the fields of a message as JSON can hold them; what is no number becomes None."""
    return {name: _value(getattr(message, name)) for name in message.__slots__}


def padded(values: Iterable[float], length: int) -> list[float]:
    """Return numbers for a fixed array of a message, with zeros behind them."""
    numbers = [float(value) for value in values]
    return numbers + [0.0] * (length - len(numbers))


def flat_columns(values: dict[str, Any]) -> Iterator[tuple[str, Any]]:
    """Return the fields that :func:`plain` gave as columns; those of a list are ``name[k]``."""
    for name, value in values.items():
        if isinstance(value, list):
            yield from flat_columns({f"{name}[{k}]": item for k, item in enumerate(value)})
        else:
            yield name, value


def json_schema(message_type: Any) -> dict[str, Any]:
    """Return the JSON Schema of what :func:`plain` makes of a generated LCM type."""
    table = zip(
        message_type.__slots__,
        message_type.__typenames__,
        message_type.__dimensions__,
        strict=True,
    )
    return {
        "title": message_type.__name__,
        "type": "object",
        "properties": {name: _schema(type_name, shape) for name, type_name, shape in table},
    }


def _value(value: Any) -> Any:
    if isinstance(value, tuple | list):
        return [_value(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def _schema(type_name: str, shape: list[Any] | None) -> dict[str, Any]:
    if shape:
        return {"type": "array", "items": _schema(type_name, shape[1:])}
    names = {"string": "string", "boolean": "boolean", "double": "number", "float": "number"}
    return {"type": names.get(type_name, "integer")}

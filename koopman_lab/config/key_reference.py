"""Every key of a configuration: its value, the unit, the default, and where the value comes from.

What a value means and its source (the paper's section, a measurement, an assumption) is said once,
in a comment of the file of defaults; here it is read from there.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from functools import cache
from importlib import resources
from pathlib import Path
from typing import Any, NamedTuple

from koopman_lab.config.layer import Layer
from koopman_lab.config.yaml_text import Key

NOTHING = "nothing"
"""The value of a key that is not there, such as those of a section that is null."""
SYMBOLS = {
    **{name: name for name in ("s", "m", "rad", "kg", "bytes", "ppm")},
    **{"hz": "Hz", "v": "V", "a": "A", "ah": "Ah", "ohm": "Ohm", "n": "N"},
    **{"s2": "s^2", "m2": "m^2"},
}
"""Units as names of keys end in them, and as a person writes them."""
TRIPLES = {"pose": "m, m, rad", "offset": "m, m, rad"}
"""Units of what is no single number, by the last word of the key."""
_COMMENT = re.compile(r"(?:^|\s)#\s?(.*)$")
_ONLY_COMMENT = re.compile(r"^\s{12,}#")
"""A comment that goes on from the line before; those of a section of its own begin further left."""


class KeyFacts(NamedTuple):
    """What there is to say of one key.

    Attributes
    ----------
    key
        With dots between its parts.
    value, default
        As in YAML; :data:`NOTHING` where the key is not there.
    unit
        Of the value; empty where it has none.
    place
        File and line that say the value, or the option or variable.
    reason
        What the file says of it: the source, or what it is.
    """

    key: str
    value: Any
    default: Any
    unit: str
    place: str
    reason: str


def key_facts(
    values: Mapping[str, Any], defaults: Mapping[str, Any], layers: Sequence[Layer]
) -> Iterator[KeyFacts]:
    """Yield what there is to say of each key, in the order of the schema.

    Parameters
    ----------
    values, defaults
        A whole configuration and the default one, as nested values.
    layers
        From which ``values`` are made, later ones winning.
    """
    default_leaves, leaves = dict(leaves_of(defaults)), dict(leaves_of(values))
    for key in dict.fromkeys((*leaves, *default_leaves)):
        layer, line = _origin(key, layers)
        yield KeyFacts(
            ".".join(key),
            leaves.get(key, NOTHING),
            default_leaves.get(key, NOTHING),
            unit_of(key),
            f"{_short(layer.source)}:{line}" if line else layer.source,
            _reason(key, layer),
        )


def leaves_of(values: Mapping[str, Any], above: Key = ()) -> Iterator[tuple[Key, Any]]:
    """Yield each key that is no section, and its value."""
    for name, value in values.items():
        if isinstance(value, Mapping):
            yield from leaves_of(value, (*above, name))
        else:
            yield (*above, name), value


def unit_of(key: Key) -> str:
    """Return the unit of a key, which its name ends in; empty where it has none."""
    words = key[-1].split("_")
    if words[-1] in TRIPLES:
        return TRIPLES[words[-1]]
    first = len(words)
    while first > 1 and (words[first - 1] in SYMBOLS or words[first - 1] == "per"):
        first -= 1
    unit = words[first:]
    above, per, below = " ".join(unit).partition("per")
    symbols = [" ".join(SYMBOLS[word] for word in part.split()) for part in (above, below)]
    if not per:
        return symbols[0]
    return f"{symbols[0] or '1'}/{symbols[1]}" if symbols[1] else ""


def _origin(key: Key, layers: Sequence[Layer]) -> tuple[Layer, int]:
    """Return the last layer that says a key, or something above it, and the line."""
    while key:
        for layer in reversed(layers):
            if key in layer.lines:
                return layer, layer.lines[key]
        key = key[:-1]
    return layers[0], 0


def _reason(key: Key, layer: Layer) -> str:
    """Return the comment at a key, or at the nearest section above it that has one."""
    text = _text_of(layer.source)
    while key:
        comment = _comment_at(text, layer.lines.get(key, 0))
        if comment:
            return comment
        key = key[:-1]
    return ""


def _comment_at(lines: Sequence[str], number: int) -> str:
    if not 0 < number <= len(lines):
        return ""
    match = _COMMENT.search(lines[number - 1])
    if match is None:
        return ""
    parts = [match[1]]
    for line in lines[number:]:
        if not _ONLY_COMMENT.match(line):
            break
        parts.append(line.strip().lstrip("#").strip())
    return " ".join(" ".join(parts).split())


@cache
def _text_of(source: str) -> Sequence[str]:
    """Return the lines of a file that a layer came from; none where it came from elsewhere."""
    try:
        if source.startswith("defaults/"):
            file = resources.files("koopman_lab.config") / source
            return tuple(file.read_text(encoding="utf-8").splitlines())
        return tuple(Path(source).read_text(encoding="utf-8").splitlines())
    except (OSError, UnicodeDecodeError):
        return ()


def _short(source: str) -> str:
    """Return the name of a file of defaults without the folder of the installation."""
    path = Path(source)
    return path.name if path.parent.name == "defaults" else source

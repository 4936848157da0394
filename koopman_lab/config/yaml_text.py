"""The one reader of YAML: bounded in size, depth and work, and without what a config never needs.

Whoever writes a text may be a stranger: a session's configuration comes off the bus, out of a log,
out of a folder that was sent by mail. Anchors and aliases let 300 bytes stand for gigabytes, a key
that is said twice hides one of two values, and deep nesting exhausts a parser; so a text is refused
before anything is made of it.
"""

from __future__ import annotations

from collections.abc import Hashable
from pathlib import Path
from typing import Any, NamedTuple

import yaml

from koopman_lab.errors import ConfigError

LARGEST_BYTES = 262_144
"""256 KiB; a whole configuration takes six of them."""
DEEPEST = 32
"""Sections within sections; a configuration has six."""
LONGEST_NUMBER = 64
"""Characters; reading one takes time that grows with their square."""
LOADER: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
"""The safe loader; that in C, where PyYAML was built with it, takes a tenth of the time."""
_NUMBERS = ("tag:yaml.org,2002:int", "tag:yaml.org,2002:float")
_MERGE = "tag:yaml.org,2002:merge"

Key = tuple[str, ...]


class YamlText(NamedTuple):
    """What a text says: plain values, None for an empty one, and the line of each key from 1."""

    value: Any
    lines: dict[Key, int]


def read_text(file: Path) -> str:
    """Read the text of one file.

    Raises
    ------
    ConfigError
        If there is no such file, it is no text in UTF-8, or longer than :data:`LARGEST_BYTES`.
    """
    try:
        with file.open("rb") as stream:
            data = stream.read(LARGEST_BYTES + 1)
    except FileNotFoundError:
        raise ConfigError(f"{file}: no such configuration file") from None
    except OSError as error:
        raise ConfigError(f"{file}: cannot be read as a configuration: {error}") from None
    _require_size(len(data), str(file))
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        raise ConfigError(
            f"{file}:{line}: cannot be read as a configuration: the byte at position "
            f"{error.start} (0x{data[error.start]:02x}) is not UTF-8; save the file as UTF-8"
        ) from None


def parse_yaml(text: str, source: str) -> YamlText:
    """Return what a YAML text says; ``source`` says where it came from.

    Raises
    ------
    ConfigError
        If it is not YAML, is longer than :data:`LARGEST_BYTES`, nested deeper than
        :data:`DEEPEST`, says a key twice, or uses anchors, aliases, merge keys or tags.
    """
    _require_size(len(text), source)
    try:
        _require_size(len(text.encode()), source)
        loader = LOADER(text)
        try:
            return _Composer(loader, source).document()
        finally:
            loader.dispose()
    except UnicodeEncodeError as error:
        line = text.count("\n", 0, error.start) + 1
        raise ConfigError(f"{source}:{line}: not valid YAML: a character is half of one") from None
    except yaml.reader.ReaderError as error:
        line = text.count("\n", 0, error.position) + 1
        raise ConfigError(
            f"{source}:{line}: not valid YAML: the character at position {error.position} is not "
            "allowed in a text"
        ) from None
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        where = f"{source}:{mark.line + 1}" if mark else source
        reason = " ".join(str(getattr(error, "problem", None) or error).split())
        raise ConfigError(f"{where}: not valid YAML: {reason}") from None


def _require_size(size: int, source: str) -> None:
    if size > LARGEST_BYTES:
        raise ConfigError(
            f"{source}: longer than {LARGEST_BYTES // 1024} KiB, which no configuration is; see "
            "whether it is another file"
        )


class _Composer:
    """Makes plain values of the parser's events one by one, none of which stands for another."""

    def __init__(self, loader: Any, source: str) -> None:
        self._loader, self._source = loader, source
        self._lines: dict[Key, int] = {}

    def document(self) -> YamlText:
        loader = self._loader
        loader.get_event()  # the stream's start
        value = None
        if not loader.check_event(yaml.StreamEndEvent):
            loader.get_event()  # the document's
            value = self._value(loader.get_event(), ())
            loader.get_event()
        if not loader.check_event(yaml.StreamEndEvent):
            raise self._error(loader.peek_event(), "a second document; one is read")
        return YamlText(value, self._lines)

    def _value(self, event: Any, key: Key) -> Any:
        if len(key) > DEEPEST:
            raise self._error(event, f"nested deeper than {DEEPEST} sections")
        if isinstance(event, yaml.AliasEvent):
            raise self._error(
                event, f"the alias *{event.anchor}; write the values out where they are needed"
            )
        if event.anchor is not None:
            raise self._error(
                event, f"the anchor &{event.anchor}; write the values out where they are needed"
            )
        if event.tag is not None:
            raise self._error(event, f"the tag {event.tag}; write the plain value")
        if isinstance(event, yaml.ScalarEvent):
            return self._scalar(event)
        if isinstance(event, yaml.SequenceStartEvent):
            return self._sequence(key)
        return self._mapping(key)

    def _sequence(self, key: Key) -> list[Any]:
        items: list[Any] = []
        while not isinstance(event := self._loader.get_event(), yaml.SequenceEndEvent):
            item_key = (*key, str(len(items)))
            self._lines[item_key] = _line(event)
            items.append(self._value(event, item_key))
        return items

    def _mapping(self, key: Key) -> dict[Hashable, Any]:
        values: dict[Hashable, Any] = {}
        while not isinstance(event := self._loader.get_event(), yaml.MappingEndEvent):
            if not isinstance(event, yaml.ScalarEvent):
                raise self._error(event, "a key that is no word")
            name = self._value(event, key)
            inner = (*key, event.value)
            if name in values or inner in self._lines:
                first = f" (first in line {self._lines[inner]})" if inner in self._lines else ""
                raise self._error(
                    event, f"{'.'.join(inner)} is said for the second time{first}; drop one"
                )
            self._lines[inner] = _line(event)
            values[name] = self._value(self._loader.get_event(), inner)
        return values

    def _scalar(self, event: Any) -> Any:
        loader = self._loader
        tag = loader.resolve(yaml.ScalarNode, event.value, event.implicit)
        if tag in _NUMBERS and len(event.value) > LONGEST_NUMBER:
            raise self._error(event, f"a number of {len(event.value)} characters")
        if tag == _MERGE:
            raise self._error(event, "the merge key <<; write the values out where they are needed")
        node: Any = yaml.ScalarNode(tag, event.value, event.start_mark, event.end_mark)
        try:
            return loader.construct_object(node)
        except ValueError as error:
            raise self._error(event, f"{event.value!r} is no value: {error}") from None

    def _error(self, event: Any, what: str) -> ConfigError:
        return ConfigError(f"{self._source}:{_line(event)}: {what}")


def _line(event: Any) -> int:
    """Return in which line an event of the parser begins, from 1."""
    line: int = event.start_mark.line
    return line + 1

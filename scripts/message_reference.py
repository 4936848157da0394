"""Write the tables of channels and types in ``lcmtypes/README.md``; see ./scripts/show-messages."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from generated_part import write_part

from koopman_lab.bus.channels import CHANNELS
from koopman_lab.config.load import load_config

SOURCES = Path(__file__).parents[1] / "lcmtypes"
PAGE = SOURCES / "README.md"
KEYED = {"always": "signed", "when signed": "signed, once it was", "never": ""}
"""Of the protection of a channel, where the lab has a key."""
STATEMENT = re.compile(r"^(const )?(\w+) (.*);$")


class Field(NamedTuple):
    """A field of a struct, as the source has it.

    Attributes
    ----------
    type, name
        As declared; the name with its length where it is an array.
    comment
        What stands above it.
    constants
        Declared between the field above and this one, in the source's words.
    """

    type: str
    name: str
    comment: str
    constants: tuple[str, ...]


class Struct(NamedTuple):
    """What a file in ``lcmtypes`` says; ``constants`` are those behind the last field."""

    name: str
    comment: str
    fields: tuple[Field, ...]
    constants: tuple[str, ...]


def read_struct(source: str) -> Struct:
    """Return the struct of a file; a comment belongs to the line below it.

    Raises
    ------
    ValueError
        If the file holds none, or a line that is no part of one.
    """
    name, about, comment = "", "", ""
    constants: list[str] = []
    fields: list[Field] = []
    for line in map(str.strip, source.splitlines()):
        if line.startswith("//"):
            comment = f"{comment} {line[2:].strip()}".strip()
        elif line.startswith("struct "):
            name, about, comment = line.removeprefix("struct "), comment, ""
        elif line.startswith("package "):
            comment = ""
        elif statement := STATEMENT.match(line):
            constant, kind, names = statement.groups()
            if constant:
                values = ", ".join(f"`{each.strip()}`" for each in names.split(","))
                constants.append(f"{comment}: {values}" if comment else values)
            else:
                fields.append(Field(kind, names, comment, tuple(constants)))
                constants = []
            comment = ""
        elif line not in ("", "{", "}"):
            raise ValueError(f"no line of a struct: {line}")
    if not name:
        raise ValueError("no struct")
    return Struct(name, about, tuple(fields), tuple(constants))


def channel_table() -> Iterator[str]:
    """Give the lines of the table of channels."""
    config = load_config()
    yield "| channel | type | rate | who speaks | with a key |"
    yield "|---|---|---|---|---|"
    for channel in CHANNELS:
        rate_hz = channel.rate_hz(config)
        rate = "on events" if rate_hz is None else f"{rate_hz:g} Hz"
        kind = channel.type.__name__
        yield (
            f"| `{channel.suffix}` | [`{kind}`](#{kind}) | {rate} | {channel.publisher} | "
            f"{KEYED[channel.protection]} |"
        )


def type_tables(sources: Path) -> Iterator[str]:
    """Give the lines about each type."""
    for file in sorted(sources.glob("*.lcm")):
        struct = read_struct(file.read_text())
        yield f"### `{struct.name}`"
        yield ""
        yield struct.comment
        yield ""
        yield "| field | type | unit and meaning |"
        yield "|---|---|---|"
        for field in struct.fields:
            meaning = "; ".join((field.comment, *field.constants))
            yield f"| `{field.name}` | {field.type} | {meaning} |"
        if struct.constants:
            yield ""
            yield f"Constants: {'; '.join(struct.constants)}."
        yield ""


def main() -> None:
    """Write both into the page."""
    write_part(PAGE, "channels", "\n".join(channel_table()))
    write_part(PAGE, "types", "\n".join(type_tables(SOURCES)))


if __name__ == "__main__":
    main()

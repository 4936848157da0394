"""Reads the change log: which versions it tells of, and what it says of one.

Called by ./scripts/changes. The form is that of Keep a Changelog 1.1.
"""

from __future__ import annotations

import argparse
import datetime
import re
from pathlib import Path
from typing import NamedTuple

from packaging.version import InvalidVersion, Version

CHANGE_LOG = Path(__file__).parents[1] / ".github" / "CHANGELOG.md"
UNRELEASED = "Unreleased"
KINDS = ("Added", "Changed", "Deprecated", "Removed", "Fixed", "Security")
HEADING = re.compile(r"## \[(?P<version>.+)\](?: - (?P<date>\S+))?")


class Entry(NamedTuple):
    """What is said of a version; the one that is not released yet has neither number nor date."""

    version: Version | None
    date: datetime.date | None
    introduction: str
    changes: dict[str, str]
    """By their kind, as Markdown."""

    @property
    def text(self) -> str:
        """The changes as they stand in the log, without the heading of the version."""
        sections = [f"### {kind}\n\n{text}" for kind, text in self.changes.items()]
        return "\n\n".join(filter(None, [self.introduction, *sections]))


def entries(text: str) -> list[Entry]:
    """Return what a change log says, the newest version first.

    Raises
    ------
    ValueError
        If it is not of the form: a heading, a number, a date, a kind, or their order.
    """
    _, *parts = re.split(r"^(?=## )", text, flags=re.MULTILINE)
    read = [_entry(part) for part in parts]
    if not read or read[0].version is not None or any(e.version is None for e in read[1:]):
        raise ValueError(f"the first heading, and no other, is ## [{UNRELEASED}]")
    versions, dates = [[entry[k] for entry in read[1:]] for k in (0, 1)]
    if versions != sorted(set(versions), reverse=True) or dates != sorted(dates, reverse=True):
        raise ValueError("versions and dates go from the newest to the oldest")
    return read


def _entry(part: str) -> Entry:
    heading, _, rest = part.partition("\n")
    match = HEADING.fullmatch(heading)
    if match is None:
        raise ValueError(f"{heading!r} is no '## [VERSION] - DATE'")
    introduction, *sections = re.split(r"^### (.+)\n", rest, flags=re.MULTILINE)
    changes = dict(zip(sections[::2], map(str.strip, sections[1::2]), strict=True))
    unknown = [kind for kind in changes if kind not in KINDS]
    if unknown or len(changes) < len(sections) // 2:
        raise ValueError(f"{heading}: each of {', '.join(KINDS)} once at most, not {unknown}")
    introduction = introduction.strip()
    stray = re.search("^- ", introduction, flags=re.MULTILINE)
    if stray or not all(text.startswith("- ") for text in changes.values()):
        raise ValueError(f"{heading}: changes are list items below their kind")
    if match["version"] == UNRELEASED:
        return Entry(None, None, introduction, changes)
    if match["date"] is None or not changes:
        raise ValueError(f"{heading}: a released version has a date and changes")
    date = datetime.date.fromisoformat(match["date"])
    return Entry(Version(match["version"]), date, introduction, changes)


def main() -> None:
    """Print what is said of the version that is named; end with 2 where nothing is."""
    parser = argparse.ArgumentParser(
        prog="scripts/changes", description=(__doc__ or "").split("\n")[0]
    )
    parser.add_argument("version", nargs="?", help="number or tag; what is not released if none")
    name = parser.parse_args().version
    try:
        read = entries(CHANGE_LOG.read_text())
    except ValueError as error:
        parser.error(f"{CHANGE_LOG}: {error}")
    try:
        version = None if name is None else Version(name)
    except InvalidVersion:
        parser.error(f"{name} is no version")
    entry = next((e for e in read if e.version == version), None)
    if entry is None:
        known = ", ".join(str(e.version) for e in read[1:])
        parser.error(f"{CHANGE_LOG.name} says nothing of {name}, but of {known}")
    print(entry.text)


if __name__ == "__main__":
    main()

"""What the guides tell a person to type: their blocks, and the lines of these in order."""

import re
import shlex
from pathlib import Path
from typing import NamedTuple

from offboard.commands.guide import GUIDES

ROOT = Path(__file__).parents[3]
PAGES = {guide.path: (ROOT / guide.path).read_text() for guide in GUIDES.values()} | {
    str(file.relative_to(ROOT)): text
    for file in sorted((ROOT / ".github").glob("*.md"))
    if (text := file.read_text()).startswith("# ")  # else it is a form that somebody fills in
}
"""Texts of the guides, in the order in which a person reads them; then those for contributors."""
README = PAGES["README.md"]
HEREDOC = re.compile(r"^cat > (\S+) <<'END'\n(.*?)^END\n", re.M | re.S)
REPLAYS = "udpm://239.255.76.68:7668?ttl=0"
"""The bus that the guides keep for replays."""


class Block(NamedTuple):
    """What stands between two fences, and the language behind the first."""

    language: str
    text: str


class Section(NamedTuple):
    """What stands under a heading of the second level, or before the first of them."""

    page: str
    title: str
    text: str


def blocks(text: str) -> list[Block]:
    """Return the fenced blocks of a text, in order."""
    fenced = re.findall(r"^```(\S*)[^\n]*\n(.*?)^```", text, re.M | re.S)
    return [Block(language, inside) for language, inside in fenced]


def sections(page: str) -> list[Section]:
    """Return the sections of a page, in order."""
    title, texts, fenced = "", {"": ""}, False
    for line in PAGES[page].splitlines(keepends=True):
        fenced ^= line.startswith("```")
        if line.startswith("## ") and not fenced:
            title = line[3:].strip()
            assert title not in texts, f"{page}: two sections {title!r}"
            texts[title] = ""
        else:
            texts[title] += line
    return [Section(page, title, text) for title, text in texts.items()]


def section(page: str, title: str) -> str:
    """Return the text of a section."""
    (found,) = (s.text for s in sections(page) if s.title == title)
    return found


def words_of(text: str) -> list[list[str]]:
    """Return the words of each line in the shell blocks of a text, but for what goes into files.

    A block of Python is one line, as a shell would be given it.
    """
    lines = []
    for language, inside in blocks(text):
        if language == "python":
            lines.append(["python", "-c", inside])
        elif language == "bash":
            typed = HEREDOC.sub("", inside).splitlines()
            lines += [words for line in typed if (words := shlex.split(line, comments=True))]
    return lines


INSIDE = "What stands in this folder"
"""The heading in the guide of a room behind which it is told how to add to it."""


def is_inside(section: Section) -> bool:
    """Return whether a section stands behind that heading, or is headed by it."""
    titles = [other.title for other in sections(section.page)]
    return INSIDE in titles and titles.index(section.title) >= titles.index(INSIDE)


SECTIONS = [section for page in PAGES for section in sections(page)]
EXAMPLES = {
    page: text
    for page in PAGES
    if blocks(text := "".join(s.text for s in SECTIONS if s.page == page and is_inside(s)))
}
"""What stands inside of each room is worked through as a whole, in a folder of its own."""
TYPED = "".join(section.text for section in SECTIONS if not is_inside(section))
"""All else is typed line by line, each on what those before it left."""
LINES = words_of(TYPED)
BY_HAND = dict(HEREDOC.findall(TYPED))
"""Files that a person writes, with what is in them."""

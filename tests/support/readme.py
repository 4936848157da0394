"""What the READMEs tell a person to type: their blocks, and the lines of these in order."""

import re
import shlex
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).parents[2]
README = (ROOT / "README.md").read_text()
ROOM_READMES = sorted(ROOT.glob("[!.]*/README.md"))
"""Those of the rooms; each is a worked example from its first block to its last."""
HEREDOC = re.compile(r"^cat > (\S+) <<'END'\n(.*?)^END\n", re.M | re.S)


class Block(NamedTuple):
    """What stands between two fences, and the language behind the first."""

    language: str
    text: str


def blocks(text: str) -> list[Block]:
    """Return the fenced blocks of a text, in order."""
    fenced = re.findall(r"^```(\S*)[^\n]*\n(.*?)^```", text, re.M | re.S)
    return [Block(language, inside) for language, inside in fenced]


def words_of(text: str) -> list[list[str]]:
    """Return the words of each line in the shell blocks of a text, but for what goes into files."""
    return [
        words
        for language, inside in blocks(text)
        if language == "bash"
        for line in HEREDOC.sub("", inside).splitlines()
        if (words := shlex.split(line, comments=True))
    ]


LINES = words_of(README)
HOUR = README.partition("\n## Your first hour\n")[2].partition("\n## What a person does here\n")[0]
"""The README's section of the first of these names."""
REPLAYS = "udpm://239.255.76.68:7668?ttl=0"
"""The bus that the README keeps for replays."""

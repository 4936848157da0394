"""`klab guide`: the guides, in the terminal. The table says where each page is."""

from __future__ import annotations

import os
import re
from pathlib import Path
from typing import Annotated, NamedTuple

from offboard.terminal.choices import described_argument
from offboard.terminal.output import out

ABOVE = Path(__file__).parents[2]
"""The checkout, or the folder of installed packages."""
INSTALLED = Path(__file__).parents[1] / "pages"
"""Where an installation from a wheel keeps the pages that belong to no package (pyproject.toml)."""
IMAGE = re.compile(r"^!\[.*?\]\(.*?\)\n", re.M)
COMMENT = re.compile(r"<!--.*?-->\n?", re.S)


class Guide(NamedTuple):
    """A page: the file in the repository, and in a line what is in it."""

    path: str
    about: str


GUIDES = {
    "start": Guide("README.md", "what this is, and the first ten minutes"),
    "operator": Guide("offboard/README.md", "start, watch, stop, calibrate, park, replay"),
    "robot": Guide("onboard/README.md", "a real robot, its board, drivers"),
    "library": Guide("koopman_lab/README.md", "data, models, controllers, studies"),
    "messages": Guide("lcmtypes/README.md", "every LCM type and channel"),
    "troubleshooting": Guide("offboard/TROUBLESHOOTING.md", "by what you see: why, what to do"),
    "results": Guide("scripts/results/README.md", "the paper, reproduced claim by claim"),
    "architecture": Guide(".github/ARCHITECTURE.md", "how it is built, where things are, tests"),
    "contributing": Guide(".github/CONTRIBUTING.md", "how to change it, and have that taken"),
    "security": Guide(".github/SECURITY.md", "who could do what, and what is done against it"),
}
"""By topic, in the order in which they are read and their lines typed."""
Topic = Annotated[
    str | None,
    described_argument(
        "topic", {topic: guide.about for topic, guide in GUIDES.items()}, "Which page."
    ),
]


def guide(topic: Topic = None) -> None:
    """Show a guide in the terminal; without a topic, which there are.

    Example: klab guide troubleshooting
    """
    from rich.markdown import Markdown

    if topic is None:
        for name, row in GUIDES.items():
            out.print(f"klab guide {name:16} {row.about}")
        return
    page = Markdown(for_terminal(read(topic)), hyperlinks=False)
    if not out.is_terminal:
        out.print(page, soft_wrap=False)
        return
    os.environ.setdefault("LESS", "-R")  # lets colours pass
    with out.pager(styles=True):
        out.print(page, soft_wrap=False)


def read(topic: str) -> str:
    """Return the text of a guide, as the repository has it."""
    path = GUIDES[topic].path
    installed = INSTALLED / path
    return (installed if installed.is_file() else ABOVE / path).read_text(encoding="utf-8")


def for_terminal(page: str) -> str:
    """Return a page without what no terminal shows: pictures, and marks for scripts."""
    return COMMENT.sub("", IMAGE.sub("", page))

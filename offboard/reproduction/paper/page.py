"""A page of headings, text, tables and figures: Markdown, or HTML that needs no other file."""

from __future__ import annotations

import base64
import html
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

from koopman_lab.errors import DataError

STYLE = (
    "body{font-family:sans-serif;max-width:75rem;margin:auto;padding:1rem;line-height:1.4}"
    "table{border-collapse:collapse;font-size:.85rem;margin:1rem 0}"
    "td,th{border:1px solid #bbb;padding:.3rem .5rem;text-align:left;vertical-align:top}"
    "th{background:#eee}img{max-width:100%}figure{margin:1.5rem 0}"
    "pre{background:#f4f4f4;padding:.7rem;overflow-x:auto}"
)


class Heading(NamedTuple):
    """A heading; level 1 is the page's."""

    level: int
    text: str


class Text(NamedTuple):
    """A paragraph."""

    text: str


class Table(NamedTuple):
    """Column names, and rows of cells; a cell may have several lines."""

    columns: Sequence[str]
    rows: Sequence[Sequence[str]]


class Image(NamedTuple):
    """A PNG file by its path from the page, and what it shows."""

    path: str
    caption: str


class Code(NamedTuple):
    """Lines that a person types."""

    lines: Sequence[str]


Block = Heading | Text | Table | Image | Code


def as_markdown(page: Sequence[Block]) -> str:
    """Return the page as Markdown; images stay files."""
    return "\n\n".join(_markdown(block) for block in page) + "\n"


def as_html(page: Sequence[Block], folder: Path) -> str:
    """Return the page as one HTML document with its images inside.

    Raises
    ------
    DataError
        If an image cannot be read.
    """
    title = next((block.text for block in page if isinstance(block, Heading)), "")
    body = "\n".join(_html(block, folder) for block in page)
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        f"<title>{html.escape(title)}</title>\n<style>{STYLE}</style>\n</head>\n"
        f"<body>\n{body}\n</body>\n</html>\n"
    )


def _markdown(block: Block) -> str:
    if isinstance(block, Heading):
        return f"{'#' * block.level} {_escaped(block.text)}"
    if isinstance(block, Table):
        lines = [block.columns, ["---"] * len(block.columns), *block.rows]
        return "\n".join(
            "| " + " | ".join(_escaped(cell).replace("\n", "<br>") for cell in line) + " |"
            for line in lines
        )
    if isinstance(block, Image):
        return f"![{_escaped(block.caption)}]({block.path})\n\n*{_escaped(block.caption)}*"
    if isinstance(block, Code):
        return "\n".join(["```bash", *block.lines, "```"])
    return _escaped(block.text)


def _escaped(text: str) -> str:
    """Return text in which Markdown sees no table, tag or emphasis."""
    for special in ("|", "*", "_"):
        text = text.replace(special, f"\\{special}")
    return text.replace("<", "&lt;")


def _html(block: Block, folder: Path) -> str:
    escape: Callable[[str], str] = html.escape
    if isinstance(block, Heading):
        return f"<h{block.level}>{escape(block.text)}</h{block.level}>"
    if isinstance(block, Table):
        head = "".join(f"<th>{escape(name)}</th>" for name in block.columns)
        rows = [
            "".join(f"<td>{escape(cell).replace(chr(10), '<br>')}</td>" for cell in row)
            for row in block.rows
        ]
        return "\n".join(
            ["<table>", f"<tr>{head}</tr>", *(f"<tr>{row}</tr>" for row in rows), "</table>"]
        )
    if isinstance(block, Image):
        caption = escape(block.caption)
        return (
            f'<figure><img src="data:image/png;base64,{_in_base64(folder / block.path)}" '
            f'alt="{caption}"><figcaption>{caption}</figcaption></figure>'
        )
    if isinstance(block, Code):
        return f"<pre>{escape(chr(10).join(block.lines))}</pre>"
    return f"<p>{escape(block.text)}</p>"


def _in_base64(file: Path) -> str:
    try:
        return base64.b64encode(file.read_bytes()).decode()
    except OSError as error:
        raise DataError(f"{file}: cannot be read ({error.strerror})") from None

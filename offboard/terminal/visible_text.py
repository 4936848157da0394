"""Text of others as a terminal may show it: names on a bus and in a log are anybody's.

A name may hold what a terminal obeys, and what looks like the markup of the library that prints.
"""

from __future__ import annotations

import unicodedata

OBEYED = frozenset({"Cc", "Cf", "Cs", "Zl", "Zp"})
"""Categories of characters that a terminal does not show: control and format characters, halves of
pairs, breaks of lines and paragraphs."""


def visible(text: str) -> str:
    r"""Return a text in which nothing but the end of a line moves the cursor.

    Each character that is not shown is written as Python does, as ``\x1b`` or ``\t``.
    """
    return text if text.isprintable() else "".join(map(_shown, text))


def one_line(text: str) -> str:
    r"""Return a text in which a line does not end either: it is written as ``\n``."""
    return visible(text).replace("\n", r"\n")


def visible_json(text: str) -> str:
    r"""Return JSON of the same value, with ``\u009b`` and the like for what does not show."""
    return text if text.isprintable() else "".join(map(_shown_in_json, text))


def _shown_in_json(character: str) -> str:
    if _shown(character) == character:
        return character
    pairs = character.encode("utf-16-be", "surrogatepass")
    return "".join(f"\\u{pairs[k]:02x}{pairs[k + 1]:02x}" for k in range(0, len(pairs), 2))


def _shown(character: str) -> str:
    if character == "\n" or unicodedata.category(character) not in OBEYED:
        return character
    return character.encode("unicode_escape").decode()

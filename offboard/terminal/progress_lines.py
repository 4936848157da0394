"""How far long work is, in lines that fit a terminal of any width; nothing of them is cut."""

from __future__ import annotations

import textwrap
from typing import NamedTuple

SHORTEST_BAR, LONGEST_BAR = 8, 40
"""Characters."""
DONE, LEFT = "━", "─"


class Progress(NamedTuple):
    """How far work is.

    Attributes
    ----------
    what
        Is being done.
    done, total
        How much of how much; ``total`` is 0 as long as nobody knows.
    unit
        Of both.
    note
        A few words more, such as what is waited for.
    left_s
        Time (s) it will still take; None as long as nobody knows.
    """

    what: str
    done: float = 0.0
    total: float = 0.0
    unit: str = ""
    note: str = ""
    left_s: float | None = None


def progress_lines(progress: Progress, width: int) -> list[str]:
    """Return the lines for a terminal of ``width`` characters.

    One line holds it all, with a bar in what is left of it, where there is room; a note that does
    not fit stands below.
    """
    left = "" if progress.left_s is None else f"{_clock(progress.left_s)} left"
    amount = f"{progress.done:g}/{progress.total:g} {progress.unit}" if progress.total else ""
    in_front, behind = progress.what, [amount.strip(), progress.note, left]
    if len(" ".join(filter(None, [in_front, *behind]))) <= width:
        return [_with_bar(progress, in_front, list(filter(None, behind)), width)]
    behind = list(filter(None, [amount.strip(), left]))
    line = " ".join([in_front, *behind])
    first = [_with_bar(progress, in_front, behind, width)]
    if len(line) > width:
        first = textwrap.wrap(line, width)
    return first + textwrap.wrap(
        progress.note, width, initial_indent="  ", subsequent_indent="  ", break_on_hyphens=False
    )


def _with_bar(progress: Progress, in_front: str, behind: list[str], width: int) -> str:
    room = min(width - len(" ".join([in_front, *behind])) - 1, LONGEST_BAR)
    if not progress.total or room < SHORTEST_BAR:
        return " ".join([in_front, *behind])
    full = round(room * min(max(progress.done / progress.total, 0.0), 1.0))
    return " ".join([in_front, DONE * full + LEFT * (room - full), *behind])


def _clock(seconds: float) -> str:
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes // 60}:{minutes % 60:02d}:{rest:02d}"

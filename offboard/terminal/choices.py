"""Options whose choices are the rows of a table, also of those that other packages add.

What there is, is asked only when a person names one or reads the help: the command line starts
without a look at other packages.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import typer
from typer.core import TyperCommand

Names = Callable[[], Sequence[str]]
_NAMES: dict[str, Names] = {}
"""By the word that stands for them until the help is shown."""


def row_option(flag: str, word: str, names: Names, text: str) -> Any:
    """Return an option that takes a name.

    The command has the class :class:`Command`.

    Parameters
    ----------
    flag
        As it is typed.
    word
        For the name, such as ``COST``; one word for one table.
    names
        Returns the choices.
    text
        For the help.
    """
    _NAMES[word] = names

    def parse(name: str) -> str:
        choices = names()
        if name not in choices:
            listing = ", ".join(map(repr, choices)) or "nothing: no package adds one"
            raise typer.BadParameter(f"{name!r} is not one of {listing}.")
        return name

    return typer.Option(flag, metavar=word, parser=parse, help=text)


class Command(TyperCommand):
    """A command whose help lists the choices of :func:`row_option`."""

    def format_help(self, ctx: Any, formatter: Any) -> None:
        """Write the help."""
        for parameter in self.params:
            names = _NAMES.get(getattr(parameter, "metavar", None) or "")
            if names is not None and names():
                parameter.metavar = f"[{'|'.join(names())}]"
        super().format_help(ctx, formatter)

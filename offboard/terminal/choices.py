"""Options whose choices are the rows of a table, also of those that other packages add.

What there is, is asked only when a person names one or reads the help: the command line starts
without a look at other packages.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, TypeVar

import typer
from typer.core import TyperCommand

from koopman_lab.errors import ConfigError
from koopman_lab.registry import Registry, unknown_name

F = TypeVar("F", bound=Callable[..., Any])
Names = Callable[[], Sequence[str]]
_NAMES: dict[str, Names] = {}
"""By the word that stands for them until the help is shown."""


def row_option(flag: str, table: Registry[Any], text: str) -> Any:
    """Return an option that takes the name of a row.

    Naming a row that cannot be used is an expected mistake, as naming none is.

    Parameters
    ----------
    flag
        As it is typed.
    table
        Has the rows.
    text
        For the help.
    """

    def parse(name: str) -> str:
        table.get(name)
        return name

    return _option(flag, table.noun, table.names, parse, text)


def name_option(flag: str, noun: str, names: Names, text: str) -> Any:
    """Return an option that takes one of some names.

    Parameters
    ----------
    flag
        As it is typed.
    noun
        What a name is of, in words; others of the same word have the same names.
    names
        Returns the choices.
    text
        For the help.
    """

    def parse(name: str) -> str:
        if name not in names():
            raise ConfigError(unknown_name(noun, name, names()))
        return name

    return _option(flag, noun, names, parse, text)


def _option(flag: str, noun: str, names: Names, parse: Callable[[str], str], text: str) -> Any:
    placeholder = noun.upper().replace(" ", "_")
    _NAMES[placeholder] = names

    def complete(incomplete: str) -> list[str]:
        return [name for name in names() if name.startswith(incomplete)]

    return typer.Option(flag, metavar=placeholder, parser=parse, autocompletion=complete, help=text)


class Command(TyperCommand):
    """A command whose help lists the choices of :func:`row_option` and :func:`name_option`."""

    def format_help(self, ctx: Any, formatter: Any) -> None:
        """Write the help."""
        for parameter in self.params:
            names = _NAMES.get(getattr(parameter, "metavar", None) or "")
            if names is not None and names():
                parameter.metavar = f"<{'|'.join(names())}>"
        super().format_help(ctx, formatter)


class Commands(typer.Typer):
    """Several commands under one word, each of the class :class:`Command`."""

    def command(self, *arguments: Any, **options: Any) -> Callable[[F], F]:
        """Return what makes a function a command; see :meth:`typer.Typer.command`."""
        return super().command(*arguments, **{"cls": Command, **options})

"""Options and arguments whose choices are the rows of a table, also of those that others add.

What there is, is asked only when a person names one or reads the help: the command line starts
without a look at other packages.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, TypeVar

import typer
from typer.core import TyperCommand, TyperGroup

from koopman_lab.errors import ConfigError
from koopman_lab.registry import Registry, unknown_name
from offboard.terminal import plain_help

F = TypeVar("F", bound=Callable[..., Any])
Names = Callable[[], Sequence[str]]
_NAMES: dict[str, Names] = {}
"""By the word that stands for them until the help is shown."""
_ROWS: dict[str, Mapping[str, str]] = {}
"""What names stand for, by the word that stands for these."""


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
    return _option(flag, noun, names, _one_of(noun, names), text)


def described_argument(noun: str, rows: Mapping[str, str], text: str) -> Any:
    """Return an argument that takes one of some names, which the help explains one by one.

    Parameters
    ----------
    noun
        What a name is of, in words.
    rows
        Says of each name what it stands for.
    text
        For the help.
    """
    choices = _choices(noun, lambda: tuple(rows), _one_of(noun, lambda: tuple(rows)))
    _ROWS[choices["metavar"]] = rows
    return typer.Argument(help=text, **choices)


def _one_of(noun: str, names: Names) -> Callable[[str], str]:
    def parse(name: str) -> str:
        if name not in names():
            raise ConfigError(unknown_name(noun, name, names()))
        return name

    return parse


def _option(flag: str, noun: str, names: Names, parse: Callable[[str], str], text: str) -> Any:
    choices = _choices(noun, names, parse)
    _NAMES[choices["metavar"]] = names
    return typer.Option(flag, help=text, **choices)


def _choices(noun: str, names: Names, parse: Callable[[str], str]) -> dict[str, Any]:
    def complete(incomplete: str) -> list[str]:
        return [name for name in names() if name.startswith(incomplete)]

    return {"metavar": noun.upper().replace(" ", "_"), "parser": parse, "autocompletion": complete}


class Command(TyperCommand):
    """A command whose help lists the choices of what this module makes.

    Where it takes numbers, they may be negative.
    """

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Read what was typed; a mistake is said in plain words, with where to read more.

        For a completion the words are only counted: to read values takes longer than to begin.
        """
        if ctx.resilient_parsing:
            ctx.params, ctx.args, _ = self.make_parser(ctx).parse_args(list(args))
            return list(ctx.args)
        try:
            rest = super().parse_args(ctx, plain_help.with_negative_numbers(self, args))
            plain_help.require_finite(self, ctx)
            return rest
        except Exception as error:
            plain_help.explain(error, ctx)
            raise

    def format_help(self, ctx: Any, formatter: Any) -> None:
        """Write the help."""
        for parameter in self.params:
            names = _NAMES.get(getattr(parameter, "metavar", None) or "")
            if names is not None and names():
                parameter.metavar = f"<{'|'.join(names())}>"
        super().format_help(ctx, formatter)

    def collect_usage_pieces(self, ctx: Any) -> list[str]:
        """Return what stands behind the command in its first line."""
        return ["[OPTIONS]", *plain_help.usage_of_arguments(self, ctx)]

    def format_options(self, ctx: Any, formatter: Any) -> None:
        """Write what is typed, in plain words."""
        _write_options(self, ctx, formatter)

    def format_epilog(self, ctx: Any, formatter: Any) -> None:
        """Write what the names stand for."""
        super().format_epilog(ctx, formatter)
        for parameter in self.params:
            word = getattr(parameter, "metavar", None)
            if word in _ROWS:
                with formatter.section(word):
                    formatter.write_dl(list(_ROWS[word].items()))


class Group(TyperGroup):
    """Several commands, each of which the help describes by its whole first sentence."""

    def format_options(self, ctx: Any, formatter: Any) -> None:
        """Write what is typed, in plain words."""
        _write_options(self, ctx, formatter)
        self.format_commands(ctx, formatter)

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """Write the commands."""
        commands = [(name, self.get_command(ctx, name)) for name in self.list_commands(ctx)]
        rows = [
            (name, command.short_help or plain_help.first_sentence(command.help or ""))
            for name, command in commands
            if command is not None and not command.hidden
        ]
        if rows:
            with formatter.section("Commands"):
                formatter.write_dl(rows)


def _write_options(command: Any, ctx: Any, formatter: Any) -> None:
    for title, rows in zip(("Arguments", "Options"), plain_help.rows_of(command, ctx), strict=True):
        if rows:
            with formatter.section(title):
                formatter.write_dl(rows)


class Commands(typer.Typer):
    """Several commands under one word, each of the class :class:`Command`."""

    def __init__(self, **settings: Any) -> None:
        super().__init__(**{"cls": Group, "rich_markup_mode": None} | settings)

    def command(self, *arguments: Any, **options: Any) -> Callable[[F], F]:
        """Return what makes a function a command; see :meth:`typer.Typer.command`."""
        return super().command(*arguments, **{"cls": Command, **options})

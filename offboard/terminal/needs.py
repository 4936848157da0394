"""What a command needs beyond the base installation, said beside it and checked before it begins.

The mark of a command is the only place that says so: the check, its help text, ``klab doctor`` and
the tests read it from there.
"""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable, Iterator, Mapping
from typing import Any, NamedTuple, ParamSpec, TypeVar

from koopman_lab import installation

P = ParamSpec("P")
R = TypeVar("R")
MARK = "klab_needs"


class Need(NamedTuple):
    """An extra that a command needs.

    Attributes
    ----------
    extra
        Its name in ``pyproject.toml``.
    option
        The option with which the command needs it; empty if it always does.
    """

    extra: str
    option: str = ""


def needs(
    extra: str, option: str = "", when: Callable[[Mapping[str, Any]], object] | None = None
) -> Callable[[Callable[P, R]], Callable[P, R]]:
    """Mark a command that needs an extra; without it, it is refused before its body runs.

    Parameters
    ----------
    extra
        Its name in ``pyproject.toml``.
    option
        The option with which it is needed, as a person types it; empty if it always is.
    when
        Whether it is needed, by the arguments of the command; None if it always is.

    Raises
    ------
    InstallationError
        By the command, with what is missing and the command that installs it.
    """
    need = Need(extra, option)

    def mark(command: Callable[P, R]) -> Callable[P, R]:
        signature = inspect.signature(command)

        @functools.wraps(command)
        def checked(*arguments: P.args, **options: P.kwargs) -> R:
            bound = signature.bind(*arguments, **options)
            bound.apply_defaults()
            if when is None or when(bound.arguments):
                installation.require(extra, option or "this command")
            return command(*arguments, **options)

        setattr(checked, MARK, (need, *needs_of(command)))
        checked.__doc__ = _help_with_need(inspect.getdoc(command) or "", need)
        return checked

    return mark


def needs_of(command: object) -> tuple[Need, ...]:
    """Return what a command needs beyond the base installation."""
    needed: tuple[Need, ...] = getattr(command, MARK, ())
    return needed


def commands(group: Any, path: tuple[str, ...] = ()) -> Iterator[tuple[str, Any]]:
    """Yield each command of a group and of the groups in it: its words, and click's command."""
    for name, command in group.commands.items():
        if hasattr(command, "commands"):
            yield from commands(command, (*path, name))
        else:
            yield " ".join((*path, name)), command


def _help_with_need(text: str, need: Need) -> str:
    """Return a help text with what is needed, before its example."""
    what = f"{need.option} needs" if need.option else "Needs"
    sentence = f"{what} the extra {need.extra}: {installation.install_command(need.extra)}"
    before, example, after = text.partition("Example: ")
    return f"{before.rstrip()}\n\n{sentence}\n\n{example}{after}".rstrip()

"""Help in plain words: what kind of value an option takes, from where to where, none of it cut."""

from __future__ import annotations

import enum
import math
import re
import types
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Annotated, Any, Union, get_args, get_origin, get_type_hints

import typer

WORDS = {int: "whole number", float: "number", str: "text", Path: "path"}
"""What values of a type are called."""
INFINITE = "inf"
"""Part of what a value is called that may be infinite."""
NEGATIVE = re.compile(r"-(?:\.?\d|inf|nan)", re.IGNORECASE)
"""How a negative number begins."""
_PLAIN = (
    ("Input should be a valid integer, unable to parse string as an integer", "no whole number"),
    ("Input should be a valid number, unable to parse string as a number", "no number"),
    ("Input should be greater than or equal to", "expected at least"),
    ("Input should be less than or equal to", "expected at most"),
    ("Input should be", "expected"),
)
"""What the library says of a value, and the same for a person."""
_BOTH, _LEAST, _MOST = (
    re.compile(pattern) for pattern in (r"(\S+)<=x<=(\S+)", r"x>=(\S+)", r"x<=(\S+)")
)


def rows_of(command: Any, ctx: Any) -> tuple[list[tuple[str, str]], list[tuple[str, str]]]:
    """Return what the help says of arguments and of options: how each is typed, and what it is."""
    rows: dict[str, list[tuple[str, str]]] = {"argument": [], "option": []}
    types_by_name = _types(command)
    for parameter in command.get_params(ctx):
        record = parameter.get_help_record(ctx)
        if record is not None:
            typed = _typed(parameter, types_by_name.get(parameter.name), record[0])
            rows[parameter.param_type_name].append((typed, _in_words(record[1])))
    return rows["argument"], rows["option"]


def usage_of_arguments(command: Any, ctx: Any) -> list[str]:
    """Return how the arguments of a command are typed; in brackets what may be left out."""
    return [
        name if parameter.required else f"[{name}]"
        for parameter in command.get_params(ctx)
        if parameter.param_type_name == "argument" and not getattr(parameter, "hidden", False)
        for name in [str(parameter.metavar or parameter.name.upper())]
    ]


def first_sentence(text: str) -> str:
    """Return the first paragraph of a help text in one line."""
    return " ".join(text.strip().partition("\n\n")[0].split())


def require_finite(command: Any, ctx: Any) -> None:
    """Refuse numbers that are none, and those without end where a command does not name them.

    It does where ``inf`` is part of how the value is called, as in ``--duration-s S|inf``.

    Raises
    ------
    typer.BadParameter
        With the option or argument.
    """
    for parameter in command.params:
        values = ctx.params.get(parameter.name)
        for value in values if isinstance(values, (tuple, list)) else (values,):
            is_float = isinstance(value, float)
            may_be_infinite = INFINITE in (parameter.metavar or "")
            if is_float and (math.isnan(value) or (math.isinf(value) and not may_be_infinite)):
                raise typer.BadParameter(f"{value} is no number", ctx=ctx, param=parameter)


def explain(error: Exception, ctx: Any) -> None:
    """Say in plain words what is wrong with what was typed, and of which command.

    Errors of the command line library have a text and a context; nothing is done to others.
    """
    message = getattr(error, "message", None)
    if isinstance(message, str) and hasattr(error, "ctx"):
        error.ctx = error.ctx or ctx
        for jargon, plain in _PLAIN:
            message = message.replace(jargon, plain)
        error.message = message  # type: ignore[attr-defined]


def with_negative_numbers(command: Any, arguments: Sequence[str]) -> list[str]:
    """Return what was typed, each negative number so that it is taken for no option.

    A space in front of a number changes nothing of it, and begins no option. Only what stands where
    a command takes numbers is changed.
    """
    arguments = list(arguments)
    if not any(map(NEGATIVE.match, arguments)) or not _takes_numbers(command):
        return arguments
    values = {
        flag: 0 if getattr(parameter, "is_flag", False) else parameter.nargs
        for parameter in command.params
        if parameter.param_type_name == "option"
        for flag in (*parameter.opts, *parameter.secondary_opts)
    }
    read: list[str] = []
    while arguments and arguments[0] != "--":
        word = arguments.pop(0)
        count = values.get(word)
        if count is None and NEGATIVE.match(word):
            word = f" {word}"
        read += [word, *arguments[: count or 0]]
        del arguments[: count or 0]
    return read + arguments


def _types(command: Any) -> dict[str, Any]:
    """Return by its name the type of each value that a command's function takes."""
    try:
        hints = get_type_hints(command.callback, include_extras=False)
    except (NameError, TypeError):  # a function of somebody else, or none
        return {}
    return {name: _without_none(hint) for name, hint in hints.items()}


def _without_none(hint: Any) -> Any:
    if get_origin(hint) is Annotated:
        hint = get_args(hint)[0]
    if get_origin(hint) in (Union, types.UnionType):
        parts = [part for part in get_args(hint) if part is not type(None)]
        return parts[0] if len(parts) == 1 else hint
    return hint


def _takes_numbers(command: Any) -> bool:
    types_by_name = _types(command)
    return any(
        {int, float} & set(_flat(types_by_name.get(parameter.name)))
        for parameter in command.params
        if parameter.param_type_name == "argument"
    )


def _flat(hint: Any) -> Iterable[Any]:
    """Return the types that a value is made of."""
    parts = get_args(hint)
    return (hint,) if not parts else (inner for part in parts for inner in _flat(part))


def _typed(parameter: Any, hint: Any, otherwise: str) -> str:
    """Return how a parameter is typed: its flags, and in a word what follows."""
    word = parameter.metavar or _word(hint)
    if parameter.param_type_name == "argument":
        return str(word or otherwise)
    if getattr(parameter, "is_flag", False) or not word:
        return otherwise
    return f"{', '.join(parameter.opts)} {word}"


def _word(hint: Any) -> str:
    if isinstance(hint, type) and issubclass(hint, enum.Enum):
        return f"<{'|'.join(str(choice.value) for choice in hint)}>"
    parts = [WORDS.get(part, "") for part in _flat(hint)]
    return f"<{', '.join(parts)}>" if parts and all(parts) else ""


def _in_words(text: str) -> str:
    """Return a help text with its ranges in words."""
    text = _BOTH.sub(r"\1 to \2", text)
    return _MOST.sub(r"\1 or less", _LEAST.sub(r"\1 or more", text))

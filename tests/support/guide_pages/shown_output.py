"""Whether a program printed what a guide shows of it."""

import re

NUMBER = re.compile(r"-?\d+(?:\.\d+)?")
TOLERANCE = 0.02
"""Of numbers that a machine's arithmetic has a part in; and one more in the last place shown."""


def first_difference(shown: str, printed: str) -> str | None:
    """Return the first line of what is shown that was not printed, None if all were.

    The lines come in the same order; others may stand between them. `...` stands for any text.
    Words are the same, and numbers up to :data:`TOLERANCE`.
    """
    lines = iter(printed.splitlines())
    for wanted in filter(None, map(str.strip, shown.splitlines())):
        if not any(_is_like(wanted, line.strip()) for line in lines):
            return wanted
    return None


def _is_like(wanted: str, line: str) -> bool:
    pattern, numbers, place = "", [], 0
    for match in re.finditer(rf"\.\.\.|{NUMBER.pattern}", wanted):
        pattern += _words(wanted[place : match.start()])
        place = match.end()
        if match.group() == "...":
            pattern += ".*"
        else:
            pattern += f"({NUMBER.pattern})"
            numbers.append(match.group())
    there = re.fullmatch(pattern + _words(wanted[place:]), line)
    return there is not None and all(map(_is_close, numbers, there.groups()))


def _words(text: str) -> str:
    """Return what matches a text with any space in place of its spaces."""
    return r"\s+".join(map(re.escape, re.split(r"\s+", text)))


def _is_close(wanted: str, number: str) -> bool:
    last_place = 10.0 ** -len(wanted.partition(".")[2])
    return abs(float(number) - float(wanted)) <= TOLERANCE * abs(float(wanted)) + 1.01 * last_place

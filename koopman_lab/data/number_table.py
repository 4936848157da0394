"""Tables of numbers as text, from whatever program of whatever country wrote them.

A table is read whole or refused with file, line and what to do; a number is never cut in two. What
separates the numbers is decided once for a file, from all its lines: semicolons, or else commas,
or else blanks and tabs. A comma is a decimal comma where something else separates the numbers and
no decimal point occurs. A file in which it may be either is refused.

Passed over are a mark of the byte order, empty lines, comments (``#`` and ``%``), a separator at
the end of a line, quotation marks, and lines of words before the first number; the last of these
is the header. Exponents may be those of Fortran (``1.5D-03``, ``1.5-103``).
"""

from __future__ import annotations

import codecs
import re
from pathlib import Path
from typing import NamedTuple, NoReturn

import numpy as np
from numpy.typing import NDArray

from koopman_lab.errors import DataError
from koopman_lab.files import open_file

Array = NDArray[np.float64]

BYTE_ORDER_MARKS = (
    (codecs.BOM_UTF8, "utf-8"),
    (codecs.BOM_UTF32_LE, "utf-32-le"),  # before UTF-16, whose mark it begins with
    (codecs.BOM_UTF32_BE, "utf-32-be"),
    (codecs.BOM_UTF16_LE, "utf-16-le"),
    (codecs.BOM_UTF16_BE, "utf-16-be"),
)
LONGEST_QUOTE = 40
"""Characters of what a message quotes."""
BLANKS = None
"""Separates as ``str.split`` takes it."""
REMEDY = "write numbers with decimal points and blanks or semicolons between them: 0.648 0.5"

_LINE_END = re.compile(r"\r\n|\r|\n")
_COMMENT = re.compile(r"[#%].*")
_MISSING = re.compile(r"[+-]?(nan|inf|infinity|na|n/a|null|none|nil|missing)", re.IGNORECASE)
_WORD = re.compile(r"[^\W\d_]\w*.*|[(\[{].*")
_LOOSE_COMMA = re.compile(r",(?=\s)|(?<=\s),|^,")
_TIGHT_COMMA = re.compile(r"(?<=[^\s,]),(?=[^\s,])")
_BLANK_BETWEEN = re.compile(r"[^\s,]\s+[^\s,]")
_WITH_DECIMAL_COMMA = re.compile(r"[+-]?[0-9]*(,[0-9]+)?([eEdDqQ][+-]?[0-9]+)?")
_NUMBER = re.compile(
    r"([+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+))(?:[eEdDqQ]([+-]?[0-9]+)|([+-][0-9]{3}))?"
)
_COMPLEX = re.compile(r"\(.*,.*\)|[+-]?[0-9].*[ijIJ]")


class NumberTable(NamedTuple):
    """Numbers by rows and columns, and the words above the columns if there are any."""

    numbers: Array
    header: tuple[str, ...] = ()


class _Line(NamedTuple):
    number: int
    text: str


def read_number_table(path: Path) -> NumberTable:
    """Return the table that a file holds, (0, 0) if it is empty.

    Raises
    ------
    DataError
        If it cannot be read, holds anything but finite numbers, or can be read in two ways.
    """
    try:
        with open_file(path) as file:
            text = _decoded(path, file.read())
    except OSError as error:
        raise DataError(f"{path}: cannot be read ({error.strerror})") from None
    text = text.replace("\N{MINUS SIGN}", "-").replace('"', "")
    lines = [
        _Line(number, content)
        for number, line in enumerate(_LINE_END.split(text), 1)
        if (content := _COMMENT.sub("", line).strip())
    ]
    first = next((k for k, line in enumerate(lines) if not _is_words(line.text)), len(lines))
    header = _words(lines[first - 1].text) if first else ()
    lines = lines[first:]
    return NumberTable(_numbers(path, lines) if lines else np.zeros((0, 0)), tuple(header))


def _decoded(path: Path, content: bytes) -> str:
    marked = (pair for pair in BYTE_ORDER_MARKS if content.startswith(pair[0]))
    mark, encoding = next(marked, (b"", "utf-8"))
    if not mark and b"\0" in content:
        raise DataError(
            f"{path}: line {_line_of(content, content.index(0))} holds a byte of zero; it is no "
            "text, or UTF-16 without a mark of its byte order; save it as UTF-8"
        )
    try:
        return content[len(mark) :].decode(encoding)
    except UnicodeDecodeError as error:
        line = _line_of(content, error.start)
        where = f"line {line} " if encoding == "utf-8" else ""
        raise DataError(
            f"{path}: {where}is not {encoding.upper()}; it is no text, or of another encoding; "
            "save it as UTF-8"
        ) from None


def _line_of(content: bytes, position: int) -> int:
    return len(re.split(rb"\r\n|\r|\n", content[:position]))


def _words(text: str) -> list[str]:
    return [word for word in re.split(r"[\s,;]+", text.replace("'", "")) if word]


def _is_words(text: str) -> bool:
    """Return whether a line says what the columns are: nothing in it begins as a number does."""
    words = _words(text)
    return bool(words) and all(
        _WORD.fullmatch(word) and not _MISSING.fullmatch(word) for word in words
    )


def _numbers(path: Path, lines: list[_Line]) -> Array:
    separator, decimal_comma = _separator(path, lines)
    rows = []
    for line in lines:
        text = line.text.replace(",", ".") if decimal_comma else line.text
        fields = _fields(path, _Line(line.number, text), separator)
        rows.append(_row(path, line, fields))
        if len(fields) != len(rows[0]):
            raise DataError(
                f"{path}: line {line.number} holds {len(fields)} numbers, line {lines[0].number} "
                f"{len(rows[0])}; every line of a table holds as many"
            )
    table = np.array(rows)
    if not np.isfinite(table).all():
        row, column = np.argwhere(~np.isfinite(table))[0]
        raise DataError(
            f"{path}: {table[row, column]} in line {lines[row].number}, column {column + 1}; "
            "leave such pairs out of X and Y"
        )
    return table


def _separator(path: Path, lines: list[_Line]) -> tuple[str | None, bool]:
    """Return what stands between the numbers of a file, and whether its commas are decimal."""
    points = any("." in line.text for line in lines)
    first_comma = next((line for line in lines if "," in line.text), None)
    if any(";" in line.text[:-1] for line in lines):
        if first_comma is not None and points:
            _refuse(path, first_comma, "decimal points and commas in one file")
        return ";", first_comma is not None
    if first_comma is None:
        return BLANKS, False
    tight = next((line for line in lines if _TIGHT_COMMA.search(line.text)), None)
    loose = any(_LOOSE_COMMA.search(line.text) for line in lines)
    blanks = next((line for line in lines if _BLANK_BETWEEN.search(line.text)), None)
    if tight is None or (points and blanks is None):
        return ",", False
    if points:
        _refuse(path, blanks or tight, "commas and blanks both stand between numbers")
    if not loose and blanks is not None:
        for line in lines:
            if not all(map(_WITH_DECIMAL_COMMA.fullmatch, _fields(path, line, BLANKS))):
                _refuse(path, line, "commas that are not all decimal commas")
        return BLANKS, True
    return _refuse(path, tight, "a comma may be a decimal comma, or stand between two numbers")


def _refuse(path: Path, line: _Line, problem: str) -> NoReturn:
    raise DataError(f"{path}: line {line.number}: {problem} ({_quote(line.text)}); {REMEDY}")


def _quote(text: str) -> str:
    return repr(text if len(text) <= LONGEST_QUOTE else text[:LONGEST_QUOTE] + "...")


def _fields(path: Path, line: _Line, separator: str | None) -> list[str]:
    text = line.text
    # Many programs write a separator behind the last number as well.
    if text.endswith((";", ",")) and (separator is BLANKS or text.endswith(separator)):
        text = text[:-1]
    fields = text.split(separator)
    if separator is not BLANKS and not all(field.strip() for field in fields):
        _refuse(path, line, "nothing between two separators, where a number should be")
    return fields


def _row(path: Path, line: _Line, fields: list[str]) -> list[float]:
    try:
        if "_" not in line.text:  # which float() passes over
            return [float(field) for field in fields]
    except ValueError:
        pass
    return [_number(path, line, field.strip()) for field in fields]


def _number(path: Path, line: _Line, field: str) -> float:
    match = _NUMBER.fullmatch(field)
    if match is not None:
        mantissa, exponent, short_exponent = match.groups()
        return float(f"{mantissa}e{exponent or short_exponent or 0}")
    if re.fullmatch(r"[+-]?(nan|inf|infinity)", field, re.IGNORECASE):
        return float(field)
    if _COMPLEX.fullmatch(field):
        raise DataError(
            f"{path}: line {line.number}: {_quote(field)} is a complex number, and states are "
            "real; leave such pairs out of X and Y"
        )
    raise DataError(
        f"{path}: line {line.number}: {_quote(field)} is no number; put # before a line that is "
        f"none of the table, and {REMEDY}"
    )

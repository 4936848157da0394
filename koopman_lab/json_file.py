"""JSON of files, of which nothing is believed before its types are seen; and how files are refused.

A refusal is one line: file, key, what was expected and what is there.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

from pydantic import BaseModel, ConfigDict, ValidationError, model_validator

from koopman_lab.errors import LabError
from koopman_lab.files import open_file

LARGEST_BYTES = 1 << 24
"""Assumption: of a file or a header of JSON; those of the paper's sessions have 4 kB."""


class JsonTable(BaseModel):
    """A table of JSON with known keys; derive from it. Keys that nobody reads are free."""

    model_config = ConfigDict(strict=True, frozen=True, extra="allow", allow_inf_nan=False)


class PartsOrNothing(JsonTable):
    """A table whose known parts are whole or left out, and never null; derive from it."""

    @model_validator(mode="after")
    def _no_null(self) -> PartsOrNothing:
        for name in self.model_fields_set & type(self).model_fields.keys():
            if getattr(self, name) is None:
                raise ValueError(f"{name} is null, which should be left out")
        return self


T = TypeVar("T", bound=JsonTable)


class Refusal(NamedTuple):
    """How a file that cannot be used is refused.

    Attributes
    ----------
    path
        The file.
    what
        What it should be, with its article.
    remedy
        The next step.
    error
        What to raise.
    """

    path: Path
    what: str
    remedy: str
    error: type[LabError]

    def missing(self) -> LabError:
        """Return what to raise where there is no file."""
        return self.error(f"{self.path}: no such {self.what.removeprefix('a ')}; {self.remedy}")

    def because(self, reason: str) -> LabError:
        """Return what to raise where a file is damaged, and why."""
        return self.error(f"{self.path}: damaged, or not {self.what}: {reason}; {self.remedy}")

    def entry(self, name: str, expected: str, seen: str) -> LabError:
        """Return what to raise where an entry is not as expected."""
        shown = shortened(name if name.isprintable() else ascii(name))
        return self.because(f"{shown}: expected {expected}, found {seen}")


def read_table(refusal: Refusal, expected: type[T]) -> T:
    """Read the file of a refusal, which is one table of JSON.

    Raises
    ------
    LabError
        The refusal's, if the file is missing, damaged, or not as expected.
    """
    try:
        with open_file(refusal.path) as file:
            text = file.read(LARGEST_BYTES + 1)
    except FileNotFoundError:
        raise refusal.missing() from None
    except OSError as error:
        raise refusal.because(first_line(error)) from None
    return checked_table(refusal, parsed_table(refusal, text, "it"), expected)


def parsed_table(refusal: Refusal, text: bytes, name: str) -> dict[str, Any]:
    """Return a table of JSON; ``name`` is what the refusal calls it.

    Raises
    ------
    LabError
        The refusal's, if it is none, or too long.
    """
    if len(text) > LARGEST_BYTES:
        raise refusal.entry(name, f"at most {LARGEST_BYTES} bytes of JSON", "more")
    try:
        table = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise refusal.entry(name, "JSON", first_line(error)) from None
    if not isinstance(table, dict):
        raise refusal.entry(name, "a table of keys", shortened(repr(table)))
    return table


def checked_table(refusal: Refusal, table: Mapping[str, Any], expected: type[T]) -> T:
    """Return a table of JSON in its type.

    Raises
    ------
    LabError
        The refusal's; the message names the first key that is not as expected.
    """
    try:
        # Strict, but with the types of JSON: a list is a tuple there.
        return expected.model_validate_json(json.dumps(table))
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        key = ".".join(map(str, first["loc"])) or "all of it"
        seen = "nothing" if first["type"] == "missing" else shortened(repr(first["input"]))
        raise refusal.entry(key, first["msg"].lower(), seen) from None
    except (ValueError, RecursionError):  # no Unicode, or nested without end
        raise refusal.because("JSON that cannot be read again") from None


def first_line(error: BaseException) -> str:
    """Return in one line what an error says."""
    return shortened((str(error) or type(error).__name__).splitlines()[0])


def shortened(text: str, most: int = 100) -> str:
    """Return a text, or its beginning where it is long."""
    return text if len(text) <= most else f"{text[:most]}..."

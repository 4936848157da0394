"""Reads the files that the steps of a reproduction left, a folder each."""

from __future__ import annotations

import csv
import json
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from koopman_lab.config.moved_keys import translate
from koopman_lab.config.yaml_text import parse_yaml
from koopman_lab.errors import ConfigError, DataError

Array = NDArray[np.float64]


class StepResults:
    """Reads the files of the steps, each once.

    Parameters
    ----------
    path
        Folder with a folder for each step.

    Attributes
    ----------
    steps_read
        Names of the steps read since it was last emptied, in order.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.steps_read: list[str] = []
        self._texts: dict[Path, Any] = {}

    def summary(self, step: str, *keys: str) -> Any:
        """Return what stands under these keys of the step's ``summary.json``.

        Raises
        ------
        DataError
            If the file cannot be read, or has no such key.
        """
        return _value_at(self._read(step, "summary.json"), f"{step}/summary.json", keys)

    def config(self, step: str, *keys: str) -> Any:
        """Return what stands under these keys of the step's configuration.

        Raises
        ------
        DataError
            If the file cannot be read, or has no such key.
        """
        return _value_at(translate(self._read(step, "config.yaml")), f"{step}/config.yaml", keys)

    def rows(self, step: str, file: str, **where: str) -> list[dict[str, str]]:
        """Return the rows of a table whose columns have these values.

        Raises
        ------
        DataError
            If the file cannot be read, or has no such row.
        """
        matching = [
            row
            for row in self._read(step, file)
            if all(row.get(column) == value for column, value in where.items())
        ]
        if not matching:
            conditions = ", ".join(f"{column} {value}" for column, value in where.items())
            raise DataError(f"{step}/{file}: no row with {conditions or 'numbers'}")
        return matching

    def column(self, step: str, file: str, name: str, **where: str) -> Array:
        """Return a column of numbers of these rows.

        Raises
        ------
        DataError
            If there is none.
        """
        try:
            return np.array([float(row[name]) for row in self.rows(step, file, **where)])
        except (KeyError, ValueError):
            raise DataError(f"{step}/{file}: no numbers in a column {name}") from None

    def ends_mm(self, study: str, case: str) -> Array:
        """Return |x2| at the end of each run of a study's case in mm; infinite where one failed.

        Raises
        ------
        DataError
            If the study has no such case.
        """
        rows = self.rows(study, "rows.csv", case=case)
        return np.array(
            [np.inf if row["reason"] else 1e3 * abs(float(row["x2_m"])) for row in rows]
        )

    def _read(self, step: str, file: str) -> Any:
        if step not in self.steps_read:
            self.steps_read.append(step)
        path = self.path / step / file
        if path not in self._texts:
            try:
                text = path.read_text()
            except OSError as error:
                missing = not path.parent.exists()
                why = "its step was not run" if missing else f"cannot be read ({error.strerror})"
                raise DataError(f"{step}/{file}: {why}") from None
            except ValueError:
                raise DataError(f"{step}/{file}: is no text; run its step again") from None
            self._texts[path] = _parse_file(path, text)
        return self._texts[path]


def _parse_file(path: Path, text: str) -> Any:
    try:
        if path.suffix == ".json":
            return json.loads(text)
        if path.suffix == ".yaml":
            return parse_yaml(text, str(path)).value
        return list(csv.DictReader(text.splitlines()))
    except (ValueError, RecursionError, ConfigError, csv.Error) as error:
        reason = (str(error) or type(error).__name__).splitlines()[0]
        raise DataError(f"{path}: damaged ({reason}); run its step again") from None


def _value_at(value: Any, where: str, keys: tuple[str, ...]) -> Any:
    for key in keys:
        if not isinstance(value, dict) or key not in value:
            raise DataError(f"{where}: no {'.'.join(keys)}")
        value = value[key]
    return value

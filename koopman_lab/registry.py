"""Tables of what there is of a sort: own rows, and those that other packages add.

A package of a stranger adds a row through a Python entry point: its group names the table
(``koopman_lab.robots``), its name the row, its value the object ``module:attribute``. Names are
known without importing anything; a row is imported when it is asked for. So what is wrong with a
package of a stranger stops only whoever wants its row.
"""

from __future__ import annotations

import difflib
from collections.abc import Iterator, Mapping
from functools import cache
from importlib.metadata import Distribution, EntryPoint, entry_points, version
from pkgutil import resolve_name
from typing import Generic, TypeVar

from packaging.requirements import InvalidRequirement, Requirement

from koopman_lab.errors import ConfigError, PluginError

T = TypeVar("T")
DISTRIBUTION = "koopman-lab"


class Registry(Generic[T]):
    """One table.

    Parameters
    ----------
    noun
        What a row is, in words for a person, such as ``robot``.
    group
        Of the entry points by which others add rows.
    row_type
        What every row is an instance of.
    builtin
        Our own rows: names, and where each is, as ``module:attribute``.
    """

    def __init__(
        self, noun: str, group: str, row_type: type[T], builtin: Mapping[str, str]
    ) -> None:
        self.noun = noun
        self.group = group
        self._row_type = row_type
        self._builtin = dict(builtin)
        self._rows: dict[str, T] = {}
        self._registered: set[str] = set()

    def names(self) -> tuple[str, ...]:
        """Return the names of all rows, our own first, without importing one."""
        others = {point.name for point in _entry_points(self.group)} | self._registered
        return (*self._builtin, *sorted(others - self._builtin.keys()))

    def __contains__(self, name: object) -> bool:
        """Return whether there is a row of a name, usable or not."""
        return name in self.names()

    def __iter__(self) -> Iterator[T]:
        """Return the rows that can be used; :meth:`faults` says what is wrong with the others."""
        for name in self.names():
            row = self._row_or_fault(name)
            if not isinstance(row, PluginError):
                yield row

    def get(self, name: str) -> T:
        """Return the row of a name.

        Raises
        ------
        ConfigError
            If there is none.
        PluginError
            If a package of a stranger adds it and it cannot be used.
        """
        row = self._rows.get(name)
        if row is None:
            row = self._rows[name] = self._load(name)
        return row

    def register(self, name: str, row: T) -> None:
        """Add a row for this process, as a script or a notebook does.

        Raises
        ------
        ConfigError
            If the name is taken by another row.
        """
        if name in self.names() and self._rows.get(name) is not row:
            raise ConfigError(f"{self.noun} {name!r} is there already; choose another name")
        self._registered.add(name)
        self._rows[name] = row

    def forget(self, name: str) -> None:
        """Take out a row that :meth:`register` added."""
        self._registered.discard(name)
        self._rows.pop(name, None)

    def faults(self) -> list[str]:
        """Return what is wrong with rows of other packages, a message each."""
        rows = map(self._row_or_fault, self.names())
        return [str(row) for row in rows if isinstance(row, PluginError)]

    def _row_or_fault(self, name: str) -> T | PluginError:
        try:
            return self.get(name)
        except PluginError as error:
            return error

    def _load(self, name: str) -> T:
        points = [point for point in _entry_points(self.group) if point.name == name]
        builtin = self._builtin.get(name)
        providers = [*([DISTRIBUTION] if builtin else []), *map(_package, points)]
        if len(providers) > 1:
            raise PluginError(
                f"{self.noun} {name!r} is in {' and in '.join(providers)}; uninstall all but one, "
                "or ask their authors for another name"
            )
        if builtin is not None:
            return self._checked(resolve_name(builtin), builtin)
        if not points:
            raise ConfigError(self._unknown(name))
        (point,) = points
        where = f"{self.noun} {name!r} of the package {_package(point)} ({point.value})"
        _require_version(point, where)
        try:
            row = point.load()
        except Exception as error:  # whatever a stranger's module does on import
            reason = f"{type(error).__name__}: {error}"
            raise PluginError(
                f"{where} cannot be loaded: {reason}; mend or uninstall it"
            ) from error
        return self._checked(row, where)

    def _checked(self, row: object, where: str) -> T:
        if not isinstance(row, self._row_type):
            raise PluginError(
                f"{where} is of type {type(row).__name__}, expected {self._row_type.__name__}; "
                "mend or uninstall it"
            )
        return row

    def _unknown(self, name: str) -> str:
        near = difflib.get_close_matches(name, self.names(), n=1)
        hint = f"; did you mean {near[0]}?" if near else ""
        known = ", ".join(self.names()) or "none"
        return f"unknown {self.noun} {name!r}, known: {known}{hint}"


def _require_version(point: EntryPoint, where: str) -> None:
    """Refuse a row of a package that says it was made for another version of this one."""
    for text in (point.dist.requires if point.dist else None) or ():
        try:
            requirement = Requirement(text)
        except InvalidRequirement:
            continue
        here = version(DISTRIBUTION)
        same = requirement.name.lower().replace("_", "-") == DISTRIBUTION
        if same and not requirement.specifier.contains(here, prereleases=True):
            raise PluginError(
                f"{where} is for {DISTRIBUTION}{requirement.specifier}, this is {here}; install a "
                "version of the package that fits"
            )


def _package(point: EntryPoint) -> str:
    distribution: Distribution | None = point.dist
    return distribution.metadata["Name"] if distribution else "of an unknown package"


@cache
def _entry_points(group: str) -> tuple[EntryPoint, ...]:
    return tuple(entry_points(group=group))

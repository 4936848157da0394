"""Tables of robots, nodes, costs and the like: built-in rows, and those that packages add.

A package of a stranger adds a row through a Python entry point: its group names the table
(``koopman_lab.robots``), its name the row, its value the object ``module:attribute``. Names are
known without importing anything; a row is imported when it is asked for. So what is wrong with a
package of a stranger stops only whoever asks for its row. ``klab doctor`` lists them all.
"""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterator, Mapping, Sequence
from functools import cache
from pkgutil import resolve_name
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from koopman_lab.errors import ConfigError, PluginError
from koopman_lab.installation import DISTRIBUTION

if TYPE_CHECKING:
    from importlib.metadata import Distribution, EntryPoint

T = TypeVar("T")
NAME = re.compile(r"[a-z][a-z0-9_]{0,29}")
"""Names of rows are typed, and are parts of the names of channels and files."""


class Registry(Generic[T]):
    """One table of rows by their names.

    Parameters
    ----------
    noun
        What a row is, in words for a person, such as ``robot``.
    group
        The group of entry points by which other packages add rows.
    row_type
        What every row is an instance of; it has a ``name``.
    builtin
        Our own rows by their names: each is the row, or where it is, as ``module:attribute``.
    """

    def __init__(
        self, noun: str, group: str, row_type: type[T], builtin: Mapping[str, str | T]
    ) -> None:
        self.noun = noun
        self.group = group
        self._row_type = row_type
        self._builtin = dict(builtin)
        self._rows: dict[str, T] = {}
        self._registered: dict[str, T] = {}

    def builtin_names(self) -> tuple[str, ...]:
        """Return the names of the built-in rows, without a look at other packages."""
        return tuple(self._builtin)

    def plugin_names(self) -> tuple[str, ...]:
        """Return the names of the rows that others add, without importing one."""
        names = {point.name for point in _entry_points(self.group)} | self._registered.keys()
        return tuple(sorted(name for name in names if NAME.fullmatch(name)))

    def names(self) -> tuple[str, ...]:
        """Return the names of all rows, our own first, without importing one."""
        return (
            *self._builtin,
            *(name for name in self.plugin_names() if name not in self._builtin),
        )

    def __contains__(self, name: object) -> bool:
        """Return whether there is a row of a name, usable or not."""
        return name in self._builtin or name in self.plugin_names()

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
            If it cannot be used: another package adds it and it does not fit, or two packages
            have a row of this name.
        """
        row = self._rows.get(name)
        if row is None:
            row = self._rows[name] = self._load(name)
        return row

    def builtin_row(self, name: str) -> T | None:
        """Return the built-in row of a name, whatever others add; None if there is none."""
        row = self._builtin.get(name)
        if isinstance(row, str):
            return self._of_row_type(name, resolve_name(row), row)
        return row

    def load(self, name: str, target: Any) -> Any:
        """Return what a row says where to find: an object, or ``module:attribute``.

        Raises
        ------
        PluginError
            If another package adds the row and it is not there, or cannot be imported.
        """
        if not isinstance(target, str):
            return target
        if name in self._builtin:
            return resolve_name(target)
        try:
            return resolve_name(target)
        except (Exception, SystemExit) as error:  # whatever a stranger's module does on import
            raise PluginError(_not_loaded(self.origin(name), target, error)) from error

    def package(self, name: str) -> str | None:
        """Return the name of the package that adds a row; None for our own."""
        points = [point for point in _entry_points(self.group) if point.name == name]
        return None if name in self._builtin or not points else _package_name(points[0])

    def origin(self, name: str) -> str:
        """Return in words which row it is, and of which package."""
        points = [point for point in _entry_points(self.group) if point.name == name]
        if name in self._builtin or not points:
            return f"{self.noun} {name!r}"
        return f"{self.noun} {name!r} of the package {' and '.join(map(_package_name, points))}"

    def register(self, name: str, row: T) -> None:
        """Add a row for this process, as a script or a notebook does.

        Raises
        ------
        ConfigError
            If the name is taken by another row.
        """
        if name in self and self._registered.get(name) is not row:
            raise ConfigError(f"{self.noun} {name!r} is there already; choose another name")
        self._rows[name] = self._registered[name] = row

    def unregister(self, name: str) -> None:
        """Take out a row that :meth:`register` added."""
        self._registered.pop(name, None)
        self._rows.pop(name, None)

    def faults(self) -> dict[str, str]:
        """Return by name what is wrong with rows that other packages add, a message each."""
        names = sorted({point.name for point in _entry_points(self.group)})
        rows = {name: self._row_or_fault(name) for name in names}
        return {name: str(row) for name, row in rows.items() if isinstance(row, PluginError)}

    def _row_or_fault(self, name: str) -> T | PluginError:
        try:
            return self.get(name)
        except PluginError as error:
            return error

    def _load(self, name: str) -> T:
        points = [point for point in _entry_points(self.group) if point.name == name]
        is_builtin = name in self._builtin
        providers = [*([DISTRIBUTION] if is_builtin else []), *map(_package_name, points)]
        if len(providers) > 1:
            raise PluginError(
                f"{self.noun} {name!r} is in {' and in '.join(providers)}; uninstall all but one, "
                "or ask their authors for another name"
            )
        row = self.builtin_row(name)
        if row is not None:
            return row
        if not points:
            raise ConfigError(unknown_name(self.noun, name, self.names()))
        (point,) = points
        where = self.origin(name)
        if not NAME.fullmatch(name):
            raise PluginError(
                f"{where}: names are small letters, digits and _, at most 30, and begin with a "
                "letter; ask its author for another one"
            )
        _require_version(point, where)
        try:
            loaded = point.load()
        except (Exception, SystemExit) as error:  # whatever a stranger's module does on import
            raise PluginError(_not_loaded(where, point.value, error)) from error
        return self._of_row_type(name, loaded, f"{where} ({point.value})")

    def _of_row_type(self, name: str, row: object, where: str) -> T:
        if not isinstance(row, self._row_type):
            raise PluginError(
                f"{where} is of type {type(row).__name__}, expected {self._row_type.__name__}; "
                "mend or uninstall it"
            )
        stated_name = getattr(row, "name", name)
        if stated_name != name:
            raise PluginError(f"{where} calls itself {stated_name!r}; mend or uninstall it")
        return row


def unknown_name(noun: str, name: str, names: Sequence[str]) -> str:
    """Return what to say of a name that is none of these."""
    similar = difflib.get_close_matches(name, names, n=1)
    hint = f"; did you mean {similar[0]}?" if similar else ""
    return f"unknown {noun} {name!r}, known: {', '.join(names) or 'none'}{hint}"


def _not_loaded(where: str, target: str, error: BaseException) -> str:
    reason = f"{type(error).__name__}: {error}"
    return f"{where} ({target}) cannot be loaded: {reason}; mend or uninstall it"


def _require_version(point: EntryPoint, where: str) -> None:
    """Refuse a row of a package that says it was made for another version of this one."""
    # Here, as most runs meet no row of another package.
    from importlib.metadata import version

    from packaging.requirements import InvalidRequirement, Requirement
    from packaging.utils import canonicalize_name

    for text in (point.dist.requires if point.dist else None) or ():
        try:
            requirement = Requirement(text)
        except InvalidRequirement:
            continue
        installed, marker = version(DISTRIBUTION), requirement.marker
        if canonicalize_name(requirement.name) != DISTRIBUTION or (
            marker and not marker.evaluate()
        ):
            continue
        if not requirement.specifier.contains(installed, prereleases=True):
            raise PluginError(
                f"{where} is for {DISTRIBUTION}{requirement.specifier}, this is {installed}; "
                "install a version of the package that fits"
            )


def _package_name(point: EntryPoint) -> str:
    distribution: Distribution | None = point.dist
    return distribution.metadata["Name"] if distribution else "of an unknown name"


@cache
def _entry_points(group: str) -> tuple[EntryPoint, ...]:
    from importlib.metadata import entry_points  # takes a while, and many ask for no row of others

    return tuple(entry_points(group=group))

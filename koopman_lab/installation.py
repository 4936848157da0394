"""Which extras of the distribution are installed here, and what installs those that are not.

What an extra brings is said in ``pyproject.toml`` and nowhere else; it is read from the metadata of
the installed package. Looking imports none of it.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from koopman_lab.errors import InstallationError

if TYPE_CHECKING:
    from packaging.requirements import Requirement

DISTRIBUTION = "koopman-lab"


def packages(extra: str) -> tuple[str, ...]:
    """Return the distributions that an extra brings, those of the extras it builds on first."""
    return tuple(dict.fromkeys(_packages_of(extra)))


def missing(extra: str) -> tuple[str, ...]:
    """Return the distributions of an extra that are not installed here."""
    return tuple(name for name in packages(extra) if not _is_installed(name))


def install_command(extra: str) -> str:
    """Return the command that installs an extra."""
    return f"pip install '{DISTRIBUTION}[{extra}]'"


def require(extra: str, what: str) -> None:
    """Refuse to go on without an extra.

    Parameters
    ----------
    extra
        The extra's name.
    what
        What needs it, in words for a person.

    Raises
    ------
    InstallationError
        If packages are missing; the message names them and the command that installs them.
    """
    absent = missing(extra)
    if absent:
        raise InstallationError(
            f"{what} needs packages that are not installed here ({', '.join(absent)}); "
            f"install them: {install_command(extra)}"
        )


def _packages_of(extra: str) -> Iterator[str]:
    from importlib.metadata import requires

    from packaging.requirements import Requirement

    for text in requires(DISTRIBUTION) or ():
        requirement = Requirement(text)
        if not _belongs_to(requirement, extra):
            continue
        if requirement.name == DISTRIBUTION:
            for other in sorted(requirement.extras):
                yield from _packages_of(other)
        else:
            yield requirement.name


def _belongs_to(requirement: Requirement, extra: str) -> bool:
    """Return whether an extra brings it; what belongs to none is there wherever this runs."""
    marker = requirement.marker
    if marker is None or marker.evaluate({"extra": ""}):
        return False
    return marker.evaluate({"extra": extra})


def _is_installed(name: str) -> bool:
    from importlib.metadata import PackageNotFoundError, distribution

    try:
        distribution(name)
    except PackageNotFoundError:
        return False
    return True

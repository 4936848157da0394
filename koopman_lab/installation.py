"""What is installed here: the base, which is enough for a robot's board, and which extras.

What an extra brings is said in ``pyproject.toml`` and nowhere else; it is read from the metadata of
the installed package. Looking imports none of it.
"""

from __future__ import annotations

from collections.abc import Iterator
from importlib.metadata import PackageNotFoundError, distribution, requires
from typing import TYPE_CHECKING

from koopman_lab.errors import InstallationError

if TYPE_CHECKING:
    from packaging.requirements import Requirement

DISTRIBUTION = "koopman-lab"


def packages(extra: str) -> tuple[str, ...]:
    """Return the distributions that an extra brings, those of the extras it builds on first."""
    return tuple(dict.fromkeys(_brought(extra)))


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
        Its name.
    what
        Needs it, in words for a person.

    Raises
    ------
    InstallationError
        With what is missing, and the command that installs it.
    """
    absent = missing(extra)
    if absent:
        raise InstallationError(
            f"{what} needs packages that are not installed here ({', '.join(absent)}); "
            f"install them: {install_command(extra)}"
        )


def _brought(extra: str) -> Iterator[str]:
    from packaging.requirements import Requirement

    for text in requires(DISTRIBUTION) or ():
        requirement = Requirement(text)
        if not _belongs_to(requirement, extra):
            continue
        if requirement.name == DISTRIBUTION:
            for other in sorted(requirement.extras):
                yield from _brought(other)
        else:
            yield requirement.name


def _belongs_to(requirement: Requirement, extra: str) -> bool:
    """Return whether an extra brings it; what belongs to none is there wherever this runs."""
    marker = requirement.marker
    if marker is None or marker.evaluate({"extra": ""}):
        return False
    return marker.evaluate({"extra": extra})


def _is_installed(name: str) -> bool:
    try:
        distribution(name)
    except PackageNotFoundError:
        return False
    return True

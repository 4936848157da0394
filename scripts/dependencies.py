"""What the distribution depends on: the tree, and under which licence each part of it stands.

Called by ./scripts/licences and ./scripts/lock. A licence is read from the metadata of what is
installed here; what no program can read there stands in a table below.
"""

from __future__ import annotations

import argparse
import re
from collections.abc import Iterator
from enum import IntEnum
from importlib.metadata import PackageMetadata, PackageNotFoundError, metadata, requires
from pathlib import Path
from typing import NamedTuple

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

DISTRIBUTION = "koopman-lab"
BASE = "base"
PYPROJECT = Path(__file__).parents[1] / "pyproject.toml"
EDITABLE = ("editables",)
"""What the build needs besides, for an installation that stays linked to the checkout."""


class Copyleft(IntEnum):
    """How far a licence reaches into what is distributed together with the part."""

    NONE = 0
    """Permissive: keep the notice."""
    WEAK = 1
    """LGPL, MPL: changes of the part itself stay open; it must be possible to replace the part."""
    STRONG = 2
    """GPL, AGPL: whatever is distributed with it must stand under it as well."""
    UNKNOWN = 3


class Licence(NamedTuple):
    """A part of the tree, its version and licence; no version where it is not installed."""

    name: str
    version: str | None
    text: str
    copyleft: Copyleft


READ_BY_A_PERSON = {
    "cvxopt": "GPL-3.0-or-later",
    # GPL is one file of its repository, for an editor, which is in no wheel.
    "docutils": "public domain AND BSD-2-Clause AND PSF-2.0",
    "lcm": "LGPL-2.1-or-later",
}
"""Licences that the metadata do not say, as the files of these parts do."""

_STRONG = re.compile(r"\bA?GPL|GNU (Affero )?General Public", re.IGNORECASE)
_WEAK = re.compile(r"\bLGPL|GNU (Lesser|Library)|\bMPL|Mozilla", re.IGNORECASE)
_PERMISSIVE = re.compile(
    r"MIT|BSD|Apache|ISC|PSF|Python Software Foundation|Zlib|CC0|Unlicense|Expat|HPND|ZPL"
    r"|public domain",
    re.IGNORECASE,
)


def copyleft(text: str) -> Copyleft:
    """Return how far a licence reaches; of alternatives (OR) the least counts, else the most."""
    alternatives = re.split(r"\bOR\b", text)
    if len(alternatives) > 1:
        return min(map(copyleft, alternatives))
    if _WEAK.search(text):
        rest = _WEAK.sub("", text)
        return Copyleft.STRONG if re.search(r"\bAND\b.*\bA?GPL", rest) else Copyleft.WEAK
    if _STRONG.search(text):
        return Copyleft.STRONG
    return Copyleft.NONE if _PERMISSIVE.search(text) else Copyleft.UNKNOWN


def licence(name: str) -> Licence:
    """Return the licence of a part."""
    try:
        about = metadata(name)
    except PackageNotFoundError:
        return Licence(name, None, "not installed here", Copyleft.UNKNOWN)
    text = READ_BY_A_PERSON.get(name) or _licence_text(about)
    return Licence(name, about["Version"], text, copyleft(text))


def _licence_text(about: PackageMetadata) -> str:
    expression = about.get("License-Expression")
    if expression:
        return str(expression)
    prefix = "License :: "
    classifiers = [c for c in about.get_all("Classifier") or [] if c.startswith(prefix)]
    named = [c.rpartition(" :: ")[2] for c in classifiers if c.count(" :: ") > 1]
    free_text = " ".join((about.get("License") or "").split())[:80]
    return " AND ".join(named) or free_text or "not said"


def tree(extra: str = "") -> list[str]:
    """Return the parts that the base brings, or an extra with the base, each once, sorted."""
    names: dict[str, set[str]] = {}
    _walk(DISTRIBUTION, frozenset({extra} if extra else ()), names)
    return sorted(set(names) - {DISTRIBUTION})


def extras() -> list[str]:
    """Return the names of the extras."""
    return list(metadata(DISTRIBUTION).get_all("Provides-Extra") or [])


def _walk(name: str, wanted_extras: frozenset[str], seen: dict[str, set[str]]) -> None:
    new = {"", *wanted_extras} - seen.get(name, set())
    if not new:
        return
    seen.setdefault(name, set()).update(new)
    for requirement in _requirements(name):
        marker = requirement.marker
        if marker is None or any(marker.evaluate({"extra": extra}) for extra in new):
            _walk(canonicalize_name(requirement.name), frozenset(requirement.extras), seen)


def _requirements(name: str) -> Iterator[Requirement]:
    try:
        yield from map(Requirement, requires(name) or ())
    except PackageNotFoundError:
        return


def build_requirements() -> list[str]:
    """Return what builds the package, as pyproject.toml says."""
    (listing,) = re.findall(r"(?ms)^requires = \[(.*?)\]", PYPROJECT.read_text())
    return [*re.findall(r'"(.*?)"', listing), *EDITABLE]


def show_licences() -> None:
    """Print the licences of the base, and of what each extra brings besides."""
    base = set(tree())
    for group in (BASE, *extras()):
        names = sorted(base) if group == BASE else sorted(set(tree(group)) - base)
        print(f"{group}: {len(names)} parts")
        for part in map(licence, names):
            version = part.version or "-"
            print(f"  {part.name:28} {version:12} {part.copyleft.name.lower():8} {part.text}")


def main() -> None:
    """Do what is asked for."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("what", choices=("licences", "build-requirements"))
    if parser.parse_args().what == "licences":
        show_licences()
    else:
        print(*build_requirements(), sep="\n")


if __name__ == "__main__":
    main()

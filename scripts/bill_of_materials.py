"""Writes the bill of materials of what the lock file installs, as CycloneDX 1.6 has it in JSON.

Called by ./scripts/sbom. The same lock file gives the same bill, its time aside.
"""

from __future__ import annotations

import argparse
import re
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple
from uuid import NAMESPACE_URL, uuid5

from cyclonedx.contrib.license.factories import LicenseFactory
from cyclonedx.model import HashAlgorithm, HashType, Property
from cyclonedx.model.bom import Bom
from cyclonedx.model.component import Component, ComponentType
from cyclonedx.output.json import JsonV1Dot6
from cyclonedx.schema import SchemaVersion
from cyclonedx.validation.json import JsonStrictValidator
from dependencies import DISTRIBUTION, licence
from packageurl import PackageURL
from packaging.requirements import Requirement

LOCK = Path(__file__).parent / "requirements.lock"
HASH = re.compile(r"--hash=sha256:([0-9a-f]{64})")


class Locked(NamedTuple):
    """A package of the lock file: name, version, where it is installed, and its files' hashes."""

    name: str
    version: str
    marker: str
    sha256: tuple[str, ...]


def locked(lock_text: str) -> Iterator[Locked]:
    """Give the packages of a lock file.

    Raises
    ------
    ValueError
        If a package has no exact version or no hash.
    """
    lines = (line for line in lock_text.splitlines() if not line.lstrip().startswith("#"))
    for entry in filter(None, map(str.strip, re.split(r"\n(?=\S)", "\n".join(lines)))):
        requirement = Requirement(entry.partition("--hash")[0].rstrip(" \\\n"))
        (specifier,) = requirement.specifier
        hashes = tuple(HASH.findall(entry))
        if specifier.operator != "==" or not hashes:
            raise ValueError(f"{requirement.name}: no exact version with hashes; ./scripts/lock")
        yield Locked(requirement.name, specifier.version, str(requirement.marker or ""), hashes)


def bill(lock_text: str) -> str:
    """Return the bill of materials of a lock file, valid by the schema of CycloneDX.

    Raises
    ------
    ValueError
        If it is not valid.
    """
    components = [_component(package) for package in locked(lock_text)]
    root = Component(name=DISTRIBUTION, type=ComponentType.APPLICATION, bom_ref=DISTRIBUTION)
    bom = Bom(components=components, serial_number=uuid5(NAMESPACE_URL, lock_text))
    bom.metadata.component = root
    bom.register_dependency(root, components)
    text = JsonV1Dot6(bom).output_as_string(indent=2)
    problem = JsonStrictValidator(SchemaVersion.V1_6).validate_str(text)
    if problem is not None:
        raise ValueError(f"not valid: {problem}")
    return text


def _component(package: Locked) -> Component:
    installed = licence(package.name)
    said = [LicenseFactory().make_from_string(installed.text)] if installed.version else []
    # A package has a file for each system and Python; the hash says which ones are the package.
    properties = [Property(name="python:sha256", value=value) for value in package.sha256]
    if package.marker:
        properties.append(Property(name="python:marker", value=package.marker))
    purl = PackageURL("pypi", None, package.name, package.version)
    hashes = [HashType(alg=HashAlgorithm.SHA_256, content=package.sha256[0])]
    return Component(
        name=package.name,
        version=package.version,
        type=ComponentType.LIBRARY,
        purl=purl,
        bom_ref=str(purl),
        hashes=hashes if len(package.sha256) == 1 else [],
        licenses=said,
        properties=properties,
    )


def main() -> None:
    """Write the file that is named."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("file", type=Path)
    file = parser.parse_args().file
    text = bill(LOCK.read_text())
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(text)
    print(f"{file}: {text.count('pkg:pypi/')} references to packages")


if __name__ == "__main__":
    main()

"""What is installed, from where it is known, and under which licences."""

import json
import re
import subprocess
import sys
from importlib.metadata import requires
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT / "scripts"))

from bill_of_materials import LOCK, bill, locked, main  # noqa: E402
from dependencies import (  # noqa: E402
    PYTHONS,
    Copyleft,
    build_requirements,
    copyleft,
    extras,
    licence,
    tree,
)

SYSTEMS = (
    ("linux", "Linux", "x86_64"),
    ("linux", "Linux", "aarch64"),
    ("darwin", "Darwin", "arm64"),
)
WEAK_IN_BASE = {
    "lcm",  # LGPL: a library that is imported as it is and can be replaced by another build of it
}
WEAK_OF_DESK = {
    "casadi",  # LGPL, in the same way
}
STRONG_OF_EDMD = {
    # GPL: brought by pykoop, with which tests and one comparison check our estimator; no part of
    # what a board or a desk installs, and imported by none of our modules.
    *("cvxopt", "optht", "picos"),
}
OPTIONAL = {"bench", "mutate"}
"""Extras that no test needs, so that they are not installed here."""


def of_group(names, kind):
    return {name for name in names if licence(name).copyleft is kind}


def test_the_licences_of_the_base_and_the_desk_are_known_and_leave_our_own_alone():
    assert of_group(tree(), Copyleft.WEAK) == WEAK_IN_BASE
    assert of_group(tree("desk"), Copyleft.WEAK) == WEAK_IN_BASE | WEAK_OF_DESK
    for extra in ("", "desk", "mcap", "foxglove", "ros2", "parquet", "cluster", "rl"):
        assert not of_group(tree(extra), Copyleft.STRONG)


def test_what_is_brought_by_any_extra_is_known():
    for extra in set(extras()) - OPTIONAL:
        assert not of_group(tree(extra), Copyleft.UNKNOWN), extra
        assert of_group(tree(extra), Copyleft.STRONG) <= STRONG_OF_EDMD
    assert of_group(tree("edmd"), Copyleft.STRONG) == STRONG_OF_EDMD


def test_no_module_of_ours_imports_what_stands_under_a_strong_licence():
    pattern = re.compile(rf"^\s*(?:import|from) ({'|'.join(STRONG_OF_EDMD)})\b", re.MULTILINE)
    for package in ("koopman_lab", "onboard", "offboard", "lcmtypes", "tests", "scripts"):
        for file in (ROOT / package).rglob("*.py"):
            assert not pattern.search(file.read_text()), file


@pytest.mark.parametrize(
    ("text", "kind"),
    [
        ("MIT", Copyleft.NONE),
        ("BSD-3-Clause AND 0BSD AND Zlib", Copyleft.NONE),
        ("LGPL-2.1-or-later", Copyleft.WEAK),
        ("GNU Lesser General Public License v3 or later (LGPLv3+)", Copyleft.WEAK),
        ("MPL-2.0 AND MIT", Copyleft.WEAK),
        ("GPL-3.0-only", Copyleft.STRONG),
        ("GNU General Public License v3 (GPLv3)", Copyleft.STRONG),
        ("GNU Affero General Public License v3", Copyleft.STRONG),
        ("AGPL-3.0-or-later", Copyleft.STRONG),
        ("LGPL-3.0 AND GPL-2.0", Copyleft.STRONG),
        ("GPL-2.0-only OR MIT", Copyleft.NONE),
        ("MIT AND GPL-3.0-only", Copyleft.STRONG),
        ("Proprietary", Copyleft.UNKNOWN),
        ("not said", Copyleft.UNKNOWN),
    ],
)
def test_a_licence_is_told_by_what_it_asks(text, kind):
    assert copyleft(text) is kind


def test_the_script_lists_them():
    listed = subprocess.run(
        [sys.executable, ROOT / "scripts" / "dependencies.py", "licences"],
        capture_output=True,
        text=True,
        check=True,
    ).stdout
    assert f"base: {len(tree())} parts" in listed
    assert re.search(r"lcm +1\.5\.3 +weak +LGPL", listed)
    assert re.search(r"picos .* strong ", listed)


def requirements_of(extra):
    """Return what pyproject.toml asks for, with what its extras build on."""
    for line in requires("koopman-lab"):
        requirement = Requirement(line)
        if requirement.marker is None or requirement.marker.evaluate({"extra": extra}):
            if requirement.name == "koopman-lab":
                for inner in requirement.extras:
                    yield from requirements_of(inner)
            else:
                yield requirement


def environments():
    for python in PYTHONS:
        for platform, system, machine in SYSTEMS:
            yield {
                **{"python_version": python, "python_full_version": f"{python}.1"},
                **{"sys_platform": platform, "platform_system": system},
                **{"platform_machine": machine, "platform_python_implementation": "CPython"},
                **{"implementation_name": "cpython", "os_name": "posix"},
            }


def applies(marker, environment):
    return not marker or Requirement(f"x; {marker}").marker.evaluate(environment)


def test_the_lock_file_holds_one_version_of_everything_asked_for_on_every_python():
    packages = list(locked(LOCK.read_text()))
    wanted = [*requirements_of("dev"), *map(Requirement, build_requirements())]
    assert len(wanted) > 25
    for environment in environments():
        here = [p for p in packages if applies(p.marker, environment)]
        versions = {canonicalize_name(p.name): p.version for p in here}
        assert len(versions) == len(here)
        for requirement in wanted:
            chosen = versions[canonicalize_name(requirement.name)]
            assert requirement.specifier.contains(chosen, prereleases=True), requirement


def test_the_lock_file_names_no_place():
    text = LOCK.read_text()
    assert not re.search(r"://|--(extra-)?index|--find-links|--trusted|\bfile:|@ ", text)


def test_the_bill_of_materials_holds_every_locked_file(tmp_path, monkeypatch):
    text = bill(LOCK.read_text())  # which is valid by the schema
    document = json.loads(text)
    assert (document["bomFormat"], document["specVersion"]) == ("CycloneDX", "1.6")
    components = {c["purl"]: c for c in document["components"]}
    for package in locked(LOCK.read_text()):
        component = components[f"pkg:pypi/{canonicalize_name(package.name)}@{package.version}"]
        values = {p["value"] for p in component["properties"] if p["name"] == "python:sha256"}
        assert values == set(package.sha256)
    (lcm,) = (c for c in document["components"] if c["name"] == "lcm")
    assert lcm["licenses"] == [{"license": {"id": "LGPL-2.1-or-later"}}]
    (dependencies,) = (d for d in document["dependencies"] if d["ref"] == "koopman-lab")
    assert set(dependencies["dependsOn"]) == set(components)
    assert "://" not in re.sub(r'"\$schema": "[^"]*"', "", text)
    file = tmp_path / "build" / "sbom.json"
    monkeypatch.setattr(sys, "argv", ["bill_of_materials.py", str(file)])
    main()
    assert json.loads(file.read_text())["serialNumber"] == document["serialNumber"]


@pytest.mark.parametrize("entry", ["numpy>=1", "numpy==2.0.0", "numpy==2.0.0 --hash=md5:00"])
def test_a_package_without_version_or_hash_is_no_locked_one(entry):
    with pytest.raises(ValueError, match=r"numpy: no exact version with hashes; \./scripts/lock"):
        list(locked(entry))

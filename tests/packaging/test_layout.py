"""What stands where: the top level, and which way the arrows run."""

import ast
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
TOP_LEVEL = {
    *("pyproject.toml", "README.md", "LICENSE"),
    *("lcmtypes", "koopman_lab", "onboard", "offboard", "scripts", "tests"),
}


def tracked() -> list[Path]:
    listing = subprocess.run(
        ["git", "ls-files"], cwd=ROOT, check=True, capture_output=True, text=True
    ).stdout
    return [Path(line) for line in listing.splitlines()]


def test_the_top_level_is_what_it_should_be():
    assert {p.parts[0] for p in tracked() if not p.parts[0].startswith(".")} == TOP_LEVEL


def test_no_generated_code_is_tracked():
    assert {p.suffix for p in tracked() if p.parts[0] == "lcmtypes"} == {".lcm"}


def imports(file: Path) -> set[str]:
    names = set()
    for node in ast.walk(ast.parse(file.read_text())):
        if isinstance(node, ast.ImportFrom) and node.module:
            names.add(node.module)
        elif isinstance(node, ast.Import):
            names.update(alias.name for alias in node.names)
    return names


@pytest.mark.parametrize(
    ("package", "forbidden"),
    [
        ("koopman_lab", ("onboard", "offboard")),
        ("onboard", ("offboard",)),
    ],
)
def test_arrows_run_one_way(package, forbidden):
    for file in (ROOT / package).rglob("*.py"):
        tops = {name.split(".")[0] for name in imports(file)}
        assert not tops & set(forbidden), file


def test_offboard_touches_onboard_only_in_the_console():
    for file in (ROOT / "offboard").rglob("*.py"):
        if "console" not in file.parts:
            assert not any(name.split(".")[0] == "onboard" for name in imports(file)), file


@pytest.mark.parametrize("package", ["koopman_lab", "onboard", "offboard"])
def test_components_know_no_bus_clock_or_socket(package):
    """Only nodes, runners and the console may import lcm, time, select or signal.

    Studies measure how long they take; no result of theirs depends on it.
    """
    for file in (ROOT / package).rglob("*.py"):
        if file.name == "node.py" or {"bus", "console"} & set(file.parts):
            continue
        measures = {"time"} if "studies" in file.parts else set()
        forbidden = {"lcm", "time", "select", "signal", "socket"} - measures
        assert not imports(file) & forbidden, file

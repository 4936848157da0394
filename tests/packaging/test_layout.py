"""What stands where: the top level, the rooms, and which way the arrows run."""

import ast
import subprocess
from collections import Counter
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
TOP_LEVEL = {
    *("pyproject.toml", "README.md", "LICENSE"),
    *("lcmtypes", "koopman_lab", "onboard", "offboard", "scripts", "tests"),
}
ROOMS = {
    "koopman_lab": (
        *("robots", "geometry", "config", "eventlog", "bus", "emulation", "data", "replay"),
        *("koopman", "predictors", "evaluation", "mpc", "figures", "studies", "api"),
    ),
    "onboard": ("motor_loop", "drivers", "plant"),
    "offboard": (
        *("desk", "mocap", "logger", "sampler", "controller", "reference", "teleop", "rl"),
        *("monitor", "viewer", "terminal", "lab", "commands", "bench", "reproduction", "cli"),
    ),
}
"""In each package a room uses what stands before it, never what stands behind it."""
PACKAGES = ("lcmtypes", "koopman_lab", "onboard", "offboard")
COMPOSING = {"offboard.lab.nodes", "offboard.rl", "offboard.bench", "offboard.cli"}
"""Where a lab is put together: only here the desk touches the robot's side."""
FACE = "koopman_lab"
"""What `import koopman_lab` gives out: names of its rooms, each loaded when it is asked for."""
LONGEST_FILE = 350
MOST_FILES = 30


def tracked() -> list[Path]:
    listing = subprocess.run(
        ["git", "ls-files"], cwd=ROOT, check=True, capture_output=True, text=True
    ).stdout
    return [Path(line) for line in listing.splitlines()]


def test_the_top_level_is_what_it_should_be():
    assert {p.parts[0] for p in tracked() if not p.parts[0].startswith(".")} == TOP_LEVEL


def test_no_generated_code_is_tracked():
    assert {p.suffix for p in tracked() if p.parts[0] == "lcmtypes"} <= {".lcm", ".md"}


def modules() -> dict[str, Path]:
    """Return the product's modules by their dotted names."""
    named = {}
    for package in ROOMS:
        for file in sorted((ROOT / package).rglob("*.py")):
            parts = file.relative_to(ROOT).with_suffix("").parts
            named[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = file
    return named


MODULES = modules()


def imports(file: Path) -> set[str]:
    """Return what a file imports anywhere, as modules."""
    names = set()
    for node in ast.walk(ast.parse(file.read_text())):
        if isinstance(node, ast.ImportFrom) and node.module:
            for alias in node.names:
                full = f"{node.module}.{alias.name}"
                names.add(full if full in MODULES else node.module)
        elif isinstance(node, ast.Import):
            names.update(alias.name for alias in node.names)
    return names


IMPORTS = {module: imports(file) for module, file in MODULES.items()}


def folder(module: str) -> str:
    """Return the folder of a module, dotted."""
    return ".".join(MODULES[module].relative_to(ROOT).parts[:-1])


def arrows() -> set[tuple[str, str]]:
    """Return who uses whom, folder by folder."""
    return {
        (folder(module), folder(used))
        for module in MODULES.keys() - {FACE}
        for used in IMPORTS[module]
        if used in MODULES and folder(used) != folder(module)
    }


def test_no_two_folders_depend_on_each_other():
    """Not at a distance either: folders can be put in a row in which all arrows point back."""
    uses: dict[str, set[str]] = {name: set() for name in map(folder, MODULES)}
    for user, used in arrows():
        uses[user].add(used)
    while free := [name for name, others in uses.items() if not others & uses.keys()]:
        for name in free:
            del uses[name]
    assert not uses


def room(name: str) -> tuple[str, int] | None:
    """Return the package and the place of the room of a folder; None for a package itself."""
    package, _, rest = name.partition(".")
    return (package, ROOMS[package].index(rest.split(".")[0])) if rest else None


def test_no_arrow_points_upwards_in_the_house():
    for user, used in sorted(arrows()):
        there, here = PACKAGES.index(used.split(".")[0]), PACKAGES.index(user.split(".")[0])
        assert there <= here, (user, used)
        of_user, of_used = room(user), room(used)
        if of_user and of_used and of_user[0] == of_used[0]:
            assert of_used[1] <= of_user[1], (user, used)


def test_the_face_of_the_library_is_for_those_outside():
    """Our own modules name what they use, so that the face may stand on all of them."""
    for module, used in IMPORTS.items():
        assert FACE not in used, module
    assert {name for name in IMPORTS[FACE] if name in MODULES}


def test_every_folder_is_a_room_of_the_design():
    for module in MODULES:
        room(folder(module))


def test_only_composing_places_of_the_desk_touch_the_robots_side():
    for module, used in IMPORTS.items():
        if module.startswith("offboard") and any(name.split(".")[0] == "onboard" for name in used):
            above = {".".join(module.split(".")[:k]) for k in (2, 3)}
            assert above & COMPOSING, module


def test_files_and_folders_stay_small():
    long = {p for p in tracked() if p.suffix in (".py", ".c", ".js")}
    lengths = {p: len((ROOT / p).read_text().splitlines()) for p in long if (ROOT / p).exists()}
    assert not {p: n for p, n in lengths.items() if n > LONGEST_FILE and "uplot" not in p.parts}
    assert not {f: n for f, n in Counter(p.parent for p in tracked()).items() if n > MOST_FILES}


@pytest.mark.parametrize("package", sorted(ROOMS))
def test_components_know_no_bus_clock_or_socket(package):
    """Only nodes, runners and what a person starts may import lcm, time, select or signal.

    Studies measure how long they take; no result of theirs depends on it.
    """
    started = {"bus", "replay", "lab", "commands", "bench", "reproduction", "cli", "terminal"}
    for file in (ROOT / package).rglob("*.py"):
        if file.name == "node.py" or started & set(file.parts):
            continue
        measures = {"time"} if "studies" in file.parts else set()
        forbidden = {"lcm", "time", "select", "signal", "socket"} - measures
        assert not imports(file) & forbidden, file

"""Whether Python, packages, message types, compiler and plug-ins are as they must be."""

from __future__ import annotations

import platform
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any

from koopman_lab.errors import PluginError
from koopman_lab.installation import install_command, missing
from offboard.commands.doctor_checks.finding import Finding
from offboard.terminal.needs import commands, needs_of

if TYPE_CHECKING:
    from koopman_lab.config.schema import LabConfig
    from koopman_lab.registry import Registry


def python_version(lab: LabConfig) -> Iterator[Finding]:
    """Say which Python this is."""
    del lab
    good = sys.version_info >= (3, 10)
    yield Finding("Python", platform.python_version(), good, remedy="install Python 3.10 or newer")


def extras(klab: Any, lab: LabConfig) -> Iterator[Finding]:
    """Say which installation this is, and of each extra what is missing for which commands."""
    del lab
    commands_by_extra = _commands_by_extra(klab)
    installed = [extra for extra in commands_by_extra if not missing(extra)]
    kind = f"base and {', '.join(installed)}" if installed else "base, enough for a robot's board"
    yield Finding("installation", kind, good=True)
    for extra in commands_by_extra:
        absent = ", ".join(missing(extra))
        yield Finding(
            f"extra {extra}",
            f"without {absent} not: klab {', '.join(commands_by_extra[extra])}"
            if absent
            else "complete",
            not absent,
            needed=False,
            remedy=install_command(extra),
        )


def _commands_by_extra(klab: Any) -> dict[str, list[str]]:
    """Return by extra the commands that need it; a group all of whose commands do is one."""
    commands_by_extra: dict[str, list[str]] = {}
    sizes = Counter(name_in_full.partition(" ")[0] for name_in_full, _ in commands(klab))
    for name_in_full, command in commands(klab):
        for extra, option in needs_of(command.callback):
            commands_by_extra.setdefault(extra, []).append(f"{name_in_full} {option}".rstrip())
    for extra, names in commands_by_extra.items():
        groups = Counter(name.partition(" ")[0] for name in names)
        shown = {
            f"{group} ..." if 1 < sizes[group] == groups[group] else name
            for name in names
            for group in [name.partition(" ")[0]]
        }
        commands_by_extra[extra] = sorted(shown)
    return commands_by_extra


def packages(lab: LabConfig) -> Iterator[Finding]:
    """Say whether LCM and CasADi are those that this was made for."""
    del lab
    installed = version("lcm")
    yield Finding("lcm", installed, installed == "1.5.3", remedy="pip install lcm==1.5.3")
    if missing("desk"):
        return
    import casadi

    solvers = [name for name in ("fatrop", "ipopt") if casadi.has_nlpsol(name)]
    yield Finding(
        "CasADi solvers",
        f"casadi {version('casadi')}: {', '.join(solvers) or 'none'}",
        "fatrop" in solvers,
        remedy="pip install 'casadi>=3.8,<3.9'",
    )


def lcm_types(lab: LabConfig) -> Iterator[Finding]:
    """Say whether the generated message types are those of their sources."""
    del lab
    import lcmtypes
    from koopman_lab.bus.channels import CHANNELS

    sources = sorted((Path(__file__).parents[3] / "lcmtypes").glob("*.lcm"))
    differing = _differing(sources, Path(lcmtypes.__file__).parent)
    types = {c.type for c in CHANNELS}
    fingerprints = {t._get_packed_fingerprint() for t in types}
    yield Finding(
        "LCM types",
        f"{len(types)} types, unlike their sources: {', '.join(differing) or 'none'}",
        not differing and len(fingerprints) == len(types),
        remedy="install again: pip install -e '.[dev]'",
    )


def _differing(sources: list[Path], installed: Path) -> list[str]:
    """Return the types whose installed module does not begin as lcm-gen makes it of the source.

    What may follow is the codec of ``scripts/generate_types.py``, which depends on nothing else.
    """
    import lcm

    if not sources:  # installed from a wheel: there is nothing to compare with
        return []
    with tempfile.TemporaryDirectory() as folder:
        generator = Path(lcm.LCM_BIN_DIR) / "lcm-gen"
        subprocess.run([generator, "--python", "--ppath", folder, *sources], check=True)
        fresh = Path(folder) / "lcmtypes"
        return sorted(
            source.stem for source in sources if not _begins_as(source.stem, fresh, installed)
        )


def _begins_as(stem: str, fresh: Path, installed: Path) -> bool:
    module = installed / f"{stem}.py"
    return module.is_file() and module.read_text().startswith((fresh / f"{stem}.py").read_text())


def compiler(lab: LabConfig) -> Iterator[Finding]:
    """Say whether solvers can be compiled here."""
    del lab
    from koopman_lab.mpc import compiled

    try:
        built = compiled.library("int klab_doctor(void) { return 0; }\n")
        detail, works = f"{compiled.find_compiler()}, libraries in {built.parent}", True
    except compiled.NotCompiledError as reason:
        detail, works = str(reason), False
    yield Finding(
        "C compiler",
        detail,
        works,
        needed=False,
        remedy="the controller solves more slowly; sudo apt install gcc",
    )


def _part_fault(table: Registry[Any], name: str) -> str:
    """Return what is wrong with what a usable row refers to; empty if nothing is."""
    row = table.get(name)
    try:
        for part in ("factory", "load", "plan", "train", "write", "read"):
            table.load(name, getattr(row, part, None))
    except PluginError as error:
        return str(error)
    return ""


def _described(table: Registry[Any], name: str) -> str:
    """Return which row it is, and what it needs if it says so in words."""
    needs = getattr(table.get(name), "needs", "")
    return table.origin(name) + (f", needs {needs}" if needs and isinstance(needs, str) else "")


def plug_ins(lab: LabConfig) -> Iterator[Finding]:
    """Look at what other packages add to our tables."""
    del lab
    from koopman_lab.bus.channels import channel_faults
    from koopman_lab.bus.hardware import CAMERAS, DRIVERS
    from koopman_lab.bus.processes import PROCESSES
    from koopman_lab.config.cost_table import COSTS
    from koopman_lab.data.formats.table import FORMATS
    from koopman_lab.predictors.table import PREDICTORS
    from koopman_lab.robots.table import ROBOTS

    parts: tuple[Registry[Any], ...] = (ROBOTS, COSTS, PREDICTORS, PROCESSES, DRIVERS, CAMERAS)
    for table in (*parts, FORMATS):
        faults = table.faults()
        for name in sorted({*table.plugin_names(), *faults}):
            fault = faults.get(name) or _part_fault(table, name)
            yield Finding("plug-in", fault or _described(table, name), not fault, bad="BROKEN")
    for fault in channel_faults().values():
        yield Finding("plug-in", fault, good=False, bad="BROKEN")

"""`klab doctor`: what this machine can do, and how to mend what it cannot."""

from __future__ import annotations

import contextlib
import platform
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from koopman_lab.config.change import changed
from koopman_lab.config.schema import LabConfig
from koopman_lab.errors import BusError, ConfigError, PluginError
from koopman_lab.installation import install_command, missing
from offboard.terminal import options
from offboard.terminal.needs import commands, needs_of
from offboard.terminal.output import out

if TYPE_CHECKING:
    from koopman_lab.registry import Registry

RMEM_MAX = Path("/proc/sys/net/core/rmem_max")
TRIES = 40


@dataclass(frozen=True)
class Finding:
    """One look at the machine; ``remedy`` is empty where nothing is to be mended."""

    what: str
    detail: str
    good: bool
    needed: bool = True
    remedy: str = ""
    bad: str = "MISSING"
    """In a word, where it is needed and not good."""
    lacking: str = "missing, not needed"
    """In a word or two, where it is not needed and not good."""


def doctor(
    context: typer.Context,
    bus_only: Annotated[
        bool, typer.Option("--bus-only", help="Look at the bus only, and be silent if it works.")
    ] = False,
    config: options.ConfigFile = None,
    overrides: options.Overrides = None,
    url: options.Url = None,
) -> None:
    """Look at Python, the installation, LCM, types, the bus and its key, the compiler, plug-ins.

    Example: klab doctor
    """
    lab = options.resolve(config, overrides, None, url=url)
    checks: list[Callable[[LabConfig], Iterator[Finding]]] = [_bus, _filter, _receive_buffer]
    if not bus_only:
        extras = partial(_extras, context.find_root().command)
        checks = [_python, extras, _packages, _types, *checks, _key, _compiler, _plug_ins]
    findings = [finding for check in checks for finding in check(lab)]
    bad = [f for f in findings if not f.good and f.needed]
    for finding in findings:
        if bus_only and finding not in bad:
            continue
        verdict = "ok" if finding.good else (finding.bad if finding.needed else finding.lacking)
        out.print(f"{finding.what}: {verdict} ({finding.detail})")
        if finding.remedy and not finding.good:
            out.print(f"    {finding.remedy}")
    if bad:
        raise typer.Exit(2)


def _python(lab: LabConfig) -> Iterator[Finding]:
    del lab
    good = sys.version_info >= (3, 10)
    yield Finding("Python", platform.python_version(), good, remedy="install Python 3.10 or newer")


def _extras(klab: Any, lab: LabConfig) -> Iterator[Finding]:
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


def _packages(lab: LabConfig) -> Iterator[Finding]:
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


def _types(lab: LabConfig) -> Iterator[Finding]:
    del lab
    import lcmtypes
    from koopman_lab.bus.channels import CHANNELS

    sources = sorted((Path(__file__).parents[2] / "lcmtypes").glob("*.lcm"))
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


def _bus(lab: LabConfig) -> Iterator[Finding]:
    import lcmtypes
    from koopman_lab.bus.channels import ESTOP
    from koopman_lab.bus.multicast import route_remedy
    from koopman_lab.bus.realtime import Listener

    # Whether the key can be used is looked at apart.
    probe = changed(changed(lab, "robot", name="DOCTOR"), "bus", key_file=None)
    try:
        speaker, listener = Listener(probe), Listener(probe)
    except BusError as error:
        yield Finding("multicast", "LCM cannot be opened", good=False, remedy=str(error))
        return
    heard: list[lcmtypes.estop_t] = []
    try:
        listener.subscribe(ESTOP, heard.append)
    except BusError as error:
        yield Finding("multicast", "LCM cannot listen", good=False, remedy=str(error))
        return
    for _ in range(TRIES):
        speaker.publish(ESTOP, lcmtypes.estop_t())
        listener.spin(0.05)
        if heard:
            break
    yield Finding(
        "multicast",
        f"{lab.bus.url}, {'a message came back' if heard else 'nothing sent comes back'}",
        bool(heard),
        remedy=f"{route_remedy(lab.bus.url)}; a firewall may drop UDP as well",
    )


def _filter(lab: LabConfig) -> Iterator[Finding]:
    """Say whether the kernel keeps off what the LCM library dies of."""
    from koopman_lab.bus.realtime import Listener

    with contextlib.suppress(BusError):  # a bus that cannot be used is a finding of its own
        # What is wrong with the key is a finding of its own, too.
        fault = Listener(lab, lambda _: None).filter_fault()
        yield Finding(
            "datagram filter",
            fault or "datagrams that are none of LCM's, or too large, reach no process",
            not fault,
            needed=False,
            lacking="NONE",
            remedy="a datagram of 8 bytes from a stranger ends every process that listens; keep "
            "strangers off the bus (ttl=0, a firewall), or use Linux and a udpm:// URL",
        )


def _key(lab: LabConfig) -> Iterator[Finding]:
    """Say who may speak on the bus."""
    from koopman_lab.bus.lab_key import OPEN_BUS, configured_key, fingerprint, key_path

    try:
        key = configured_key(lab)
    except ConfigError as error:
        yield Finding("lab's key", str(error), good=False, bad="BROKEN")
        return
    if key is None:
        yield Finding("lab's key", "none", good=False, needed=False, remedy=OPEN_BUS)
        return
    yield Finding("lab's key", f"{fingerprint(key)}, of {key_path(lab)}", good=True)


def _receive_buffer(lab: LabConfig) -> Iterator[Finding]:
    requested = lab.bus.receive_buffer_bytes
    granted = int(RMEM_MAX.read_text()) if RMEM_MAX.exists() else None
    detail = "unknown here" if granted is None else f"{granted} bytes granted, {requested} wanted"
    yield Finding(
        "receive buffer",
        detail,
        granted is None or granted >= requested,
        needed=False,
        remedy=f"bursts may be lost; sudo sysctl -w net.core.rmem_max={requested}",
    )


def _compiler(lab: LabConfig) -> Iterator[Finding]:
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


def _plug_ins(lab: LabConfig) -> Iterator[Finding]:
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

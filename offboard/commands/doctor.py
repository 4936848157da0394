"""`klab doctor`: what this machine can do, and how to mend what it cannot."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from typing import TYPE_CHECKING, Annotated

import typer

from offboard.commands.doctor_checks import bus, installation, machine
from offboard.commands.doctor_checks.finding import Finding
from offboard.terminal import options
from offboard.terminal.exit_codes import ExitCode
from offboard.terminal.output import out

if TYPE_CHECKING:
    from koopman_lab.config.schema import LabConfig


def doctor(
    context: typer.Context,
    bus_only: Annotated[
        bool, typer.Option("--bus-only", help="Look at the bus only, and be silent if it works.")
    ] = False,
    config: options.ConfigFile = None,
    overrides: options.Overrides = None,
    url: options.Url = None,
) -> None:
    """Look at this machine and at the bus: what is missing, and how to mend it.

    Python, packages, message types, compiler, plug-ins; the bus, its key, and who sends each
    stream on it; timing, disk and clock. The exit code is 1 where something is missing that is
    needed.

    Example: klab doctor
    """
    lab = options.resolve(config, overrides, None, url=url)
    checks: list[Callable[[LabConfig], Iterator[Finding]]] = [
        bus.multicast,
        bus.hostile_datagrams,
        bus.receive_buffer,
    ]
    if not bus_only:
        extras = partial(installation.extras, context.find_root().command)
        checks = [
            *(installation.python_version, extras, installation.packages, installation.lcm_types),
            *(*checks, bus.lab_key, bus.streams),
            *(installation.compiler, installation.plug_ins),
            *(machine.timing, machine.disk, machine.clock),
        ]
    needed_and_bad = False
    for finding in (finding for check in checks for finding in check(lab)):
        is_bad = finding.needed and not finding.good
        needed_and_bad = needed_and_bad or is_bad
        if bus_only and not is_bad:
            continue
        verdict = "ok" if finding.good else (finding.bad if finding.needed else finding.lacking)
        out.print(f"{finding.what}: {verdict} ({finding.detail})")
        if finding.remedy and not finding.good:
            out.print(f"    {finding.remedy}")
    if needed_and_bad:
        raise typer.Exit(ExitCode.NO)

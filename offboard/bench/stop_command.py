"""`klab bench estop`: from the start of `klab estop` to its first message, beside other work."""

from __future__ import annotations

import contextlib
import json
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NamedTuple

import typer

from offboard.terminal import options
from offboard.terminal.output import Report, out, progress

if TYPE_CHECKING:
    from rich.table import Table

    from koopman_lab.bus.realtime import Listener

LOADS = (0, 2, 20)
"""Loops that count for nothing, beside the command."""
BUSY = "while True: pass"
WAIT_S = 0.01
LIMIT_S = 60.0
NS_PER_S = 1_000_000_000


class FirstMessage(NamedTuple):
    """One command.

    Attributes
    ----------
    load
        Loops that ran beside it.
    cpu_s
        CPU time that it had used when its first message was heard; None where the system does not
        say.
    wall_s
        From its start until then.
    """

    load: int
    cpu_s: float | None
    wall_s: float


def estop(
    tries: Annotated[int, typer.Option("--tries", min=1, help="Of each load.")] = 10,
    loads: Annotated[
        list[int] | None,
        typer.Option("--load", min=0, help="Busy loops beside it; several may be named."),
    ] = None,
    url: options.Url = None,
    as_json: options.AsJson = False,
) -> None:
    """Show how long `klab estop` takes to its first message, idle and on a busy machine.

    It stops a robot of a name that nobody has.

    Example: klab bench estop --tries 20 --load 0 --load 2 --load 20
    """
    from koopman_lab.bus.priority import STOP_PRIORITY, ask_for_priority

    lab = options.resolve(None, None, None, url=url, robot_name=f"BENCH{os.getpid()}")
    # What hears it must not be what is late.
    ask_for_priority(STOP_PRIORITY + 1)
    listener = options.listen(lab)
    rows: list[FirstMessage] = []
    counts = loads or list(LOADS)
    with progress("stopping", "stops") as report:
        for load in counts:
            rows += _measure(listener, lab.robot.name, lab.bus.url, load, tries, report)
    if as_json:
        out.print_json(json.dumps([row._asdict() for row in rows]))
    else:
        out.print(_table(rows))


def _measure(
    listener: Listener, robot_name: str, url: str, load: int, tries: int, report: Report
) -> list[FirstMessage]:
    from koopman_lab.bus.channels import ESTOP
    from koopman_lab.errors import LabStateError
    from koopman_lab.units import US_PER_S
    from offboard.lab.python_process import module_command

    command = module_command(
        *("offboard.cli.start", "estop", "--robot-name", robot_name, "--url", url)
    )
    heard: list[float | None] = []
    process: subprocess.Popen[bytes] | None = None
    listener.subscribe(ESTOP, lambda _: heard.append(_cpu_s(process)))
    rows: list[FirstMessage] = []
    with busy(load):
        for _ in range(tries):
            _forget(listener)
            heard.clear()
            began_us = listener.now_us()
            process = subprocess.Popen(
                command, stderr=subprocess.DEVNULL, preexec_fn=_as_an_ordinary_process
            )
            try:
                while not heard:
                    listener.spin(WAIT_S)
                    if listener.now_us() - began_us > LIMIT_S * US_PER_S:
                        raise LabStateError(
                            f"klab estop: not heard on {url} within {LIMIT_S:g} s; `klab doctor` "
                            "looks at the bus"
                        )
                wall_s = (listener.now_us() - began_us) / US_PER_S
                rows.append(FirstMessage(load, heard[0], wall_s))
                report(len(rows), tries, f"{load} busy loops")
            finally:
                process.kill()
                process.wait()
    return rows


@contextlib.contextmanager
def busy(loops: int) -> Iterator[None]:
    """Keep the machine busy in the block, with so many processes that only count."""
    command = [sys.executable, "-c", BUSY]
    processes = [
        subprocess.Popen(command, preexec_fn=_as_an_ordinary_process) for _ in range(loops)
    ]
    try:
        yield
    finally:
        for process in processes:
            process.kill()
            process.wait()


def _as_an_ordinary_process() -> None:
    """Drop what a child of this one inherits: a person's shell has no such priority."""
    with contextlib.suppress(OSError, AttributeError):
        os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
        os.setpriority(os.PRIO_PROCESS, 0, 0)


def _forget(listener: Listener) -> None:
    while listener.spin(0.0):
        pass


def _cpu_s(process: subprocess.Popen[bytes] | None) -> float | None:
    """Return the CPU time of a process (s), as Linux says it."""
    if process is None:
        return None
    try:
        return int(Path(f"/proc/{process.pid}/schedstat").read_text().split()[0]) / NS_PER_S
    except (OSError, ValueError, IndexError):
        return None


def _table(rows: list[FirstMessage]) -> Table:
    from rich.table import Table

    table = Table("busy loops", title="klab estop, from its start to its first message (s)")
    for column in ("stops", "CPU, median", "CPU, most", "wall, median", "wall, most"):
        table.add_column(column, justify="right")
    for load in dict.fromkeys(row.load for row in rows):
        of_load = [row for row in rows if row.load == load]
        walls = sorted(row.wall_s for row in of_load)
        cpus = sorted(row.cpu_s for row in of_load if row.cpu_s is not None)
        figures = [f"{times[k]:.3f}" if times else "" for times in (cpus, walls) for k in (
            len(times) // 2, -1
        )]  # fmt: skip
        table.add_row(str(load), str(len(of_load)), *figures)
    return table

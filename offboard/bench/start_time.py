"""`klab bench start`: how long `klab` takes to its help and to a completion, beside its library."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Annotated, NamedTuple

import typer

from offboard.terminal import options
from offboard.terminal.output import out, progress

if TYPE_CHECKING:
    from rich.table import Table

BASE = "python -c 'import typer'"
"""What every command line of this library takes at least; the others are compared with it."""


class Start(NamedTuple):
    """What one command takes: medians over the rounds, and as a multiple of :data:`BASE`."""

    command: str
    wall_s: float
    cpu_s: float
    wall_ratio: float
    cpu_ratio: float


def start(
    rounds: Annotated[
        int, typer.Option("--rounds", min=1, help="In each, every command runs once.")
    ] = 20,
    as_json: options.AsJson = False,
) -> None:
    """Time the help and the completion of klab beside `import typer`, in turn, in new processes.

    Ratios are of medians: of the time on the wall, and of the time on a core, which a busy machine
    changes less.

    Example: klab bench start --rounds 20
    """
    commands = _commands()
    taken: dict[str, list[tuple[float, float]]] = {name: [] for name in commands}
    with progress("starting", "rounds") as report:
        for done in range(1, rounds + 1):
            for name, (command, variables) in commands.items():
                taken[name].append(_timed(command, variables))
            report(done, rounds)
    rows = _rows(taken)
    if as_json:
        out.print_json(json.dumps([row._asdict() for row in rows]))
    else:
        out.print(_table(rows))


def _commands() -> dict[str, tuple[Sequence[str], Mapping[str, str]]]:
    """Return what is timed: by its name the command line and the variables of the environment."""
    from offboard.lab.python_process import module_command

    klab = module_command("offboard.cli.start")
    return {
        BASE: ([sys.executable, "-c", "import typer"], {}),
        "klab --help": ([*klab, "--help"], {}),
        "klab --version": ([*klab, "--version"], {}),
        "klab pa[TAB]": (klab, _completing("klab pa", 1)),
        "klab park --[TAB]": (klab, _completing("klab park --", 2)),
    }


def _completing(words: str, number: int) -> dict[str, str]:
    """Return the variables by which the shell asks what a word may become."""
    return {
        "_KLAB_COMPLETE": "complete_bash",
        "COMP_WORDS": words,
        "COMP_CWORD": str(number),
    }


def _timed(command: Sequence[str], variables: Mapping[str, str]) -> tuple[float, float]:
    """Run to the end; return the time on the wall and on a core (s)."""
    began_s = time.perf_counter()
    process = subprocess.Popen(
        command, env=os.environ | variables, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )
    _, _, usage = os.wait4(process.pid, 0)
    wall_s = time.perf_counter() - began_s
    process.returncode = 0  # waited for already
    return wall_s, usage.ru_utime + usage.ru_stime


def _rows(taken: Mapping[str, Sequence[tuple[float, float]]]) -> list[Start]:
    from statistics import median

    medians = {
        name: (median(wall_s for wall_s, _ in times), median(cpu_s for _, cpu_s in times))
        for name, times in taken.items()
    }
    base_wall_s, base_cpu_s = medians[BASE]
    return [
        Start(name, wall_s, cpu_s, wall_s / base_wall_s, cpu_s / base_cpu_s)
        for name, (wall_s, cpu_s) in medians.items()
    ]


def _table(rows: Sequence[Start]) -> Table:
    from rich.table import Table

    table = Table(title=f"medians; ratios to {BASE}")
    table.add_column("command")
    for column in ("wall (ms)", "core (ms)", "wall ratio", "core ratio"):
        table.add_column(column, justify="right")
    for row in rows:
        table.add_row(
            row.command,
            f"{1e3 * row.wall_s:.0f}",
            f"{1e3 * row.cpu_s:.0f}",
            f"{row.wall_ratio:.2f}",
            f"{row.cpu_ratio:.2f}",
        )
    return table

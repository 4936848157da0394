"""`klab bench dataset`: how long it takes from a session log to its data set."""

from __future__ import annotations

import contextlib
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any

import typer

from koopman_lab.robots.dynamic import DYNAMIC
from offboard.terminal import options
from offboard.terminal.output import err, out, progress

PAPER_PAIRS = 108_106 + 13_705 + 24_910
"""Of the paper, section 5.2, under u_0, u_1, u_2."""
AIM_S = 3.0
"""On one core, for so many pairs."""


def dataset(
    session: Annotated[
        Path | None,
        typer.Argument(
            metavar="SESSION",
            help="A session; default: one as long as the paper's, recorded in lockstep first "
            "(a minute or two).",
        ),
    ] = None,
    repetitions: Annotated[
        int, typer.Option("--repetitions", min=1, help="How often it is timed.")
    ] = 10,
    as_json: options.AsJson = False,
) -> None:
    """Time the way from a session log to its data set, on one core.

    Example: klab bench dataset --repetitions 10
    """
    with _session(session) as path:
        facts = _measure(path, repetitions)
    facts |= {"aim_s": AIM_S, "paper_pairs": PAPER_PAIRS}
    if as_json:
        out.print_json(json.dumps(facts))
        return
    from rich.table import Table

    out.print(
        f"{facts['file']}: {facts['bytes'] / 1e6:.0f} MB, {facts['events']} events, "
        f"{facts['pairs']} pairs (the paper: {PAPER_PAIRS}, here in at most {AIM_S:g} s)"
    )
    table = Table("", title=f"{repetitions} times from log to data set (s)")
    columns = ("median", "p99", "max")
    for column in columns:
        table.add_column(column, justify="right")
    for name in ("read_s", "pairs_s", "total_s", "total_cpu_s"):
        table.add_row(NAMES[name], *(f"{facts[name][column]:.2f}" for column in columns))
    out.print(table)


NAMES = {
    "read_s": "log read",
    "pairs_s": "segments, velocities, pairs",
    "total_s": "together",
    "total_cpu_s": "together, CPU time",
}


def _measure(path: Path, repetitions: int) -> dict[str, Any]:
    import time

    import numpy as np

    from koopman_lab.data.dataset import DataSet
    from koopman_lab.data.decode import SessionLog
    from koopman_lab.eventlog.logwriter import files_of_log

    rows = []
    with progress("timing", "times") as report:
        for number in range(repetitions):
            started, cpu_started = time.perf_counter(), time.process_time()
            log = SessionLog(path)
            read = time.perf_counter()
            pairs = sum(map(len, DataSet.from_log(log).X.values()))
            ended, cpu_ended = time.perf_counter(), time.process_time()
            rows.append((read - started, ended - read, ended - started, cpu_ended - cpu_started))
            report(number + 1, repetitions, f"{ended - started:.2f} s")
    percentiles = np.percentile(rows, [50.0, 99.0, 100.0], axis=0).T.tolist()
    facts: dict[str, Any] = {
        "file": str(log.path),
        "bytes": sum(file.stat().st_size for file in files_of_log(log.path)),
        "events": sum(channel.count for channel in log.channels.values()),
        "pairs": pairs,
        "repetitions": repetitions,
    }
    return facts | {
        name: dict(zip(("median", "p99", "max"), values, strict=True))
        for name, values in zip(NAMES, percentiles, strict=True)
    }


@contextlib.contextmanager
def _session(session: Path | None) -> Iterator[Path]:
    """Give the session, or one recorded for this and removed afterwards."""
    if session is not None:
        yield session
        return
    import tempfile

    from offboard.lab.calibration import calibrate
    from offboard.lab.run_folder import new_folder

    with tempfile.TemporaryDirectory(prefix="koopman-lab-") as place:
        lab = options.resolve(None, None, DYNAMIC.name)
        folder = new_folder(Path(place) / "session", "bench", lab)
        calibrate(lab, folder, None)
        err.print("recorded a session of the dynamic robot")
        yield folder.path

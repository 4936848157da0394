"""Shares the runs of a study among processes, and goes on where it was interrupted.

Rows are appended to ``rows.jsonl`` as they come; ``rows.csv`` is made from all of them in the end,
sorted, and so does not depend on who ran what and when.
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from koopman_lab.errors import DataError
from koopman_lab.files import replacing, sha256, write_csv, write_json
from koopman_lab.studies.parking import COLUMNS, Case, run

Row = dict[str, Any]


def run_all(
    folder: Path,
    cases: Sequence[Case],
    runs: int,
    workers: int = 1,
    chunk: int = 5,
    resume: bool = False,
    on_progress: Callable[[int, int], None] = lambda _done, _total: None,
) -> list[Row]:
    """Run every case from starts 0 to ``runs`` - 1; leave ``rows.csv`` in the folder.

    Parameters
    ----------
    folder
        Of the study.
    cases
        With different labels.
    runs
        Of each case.
    workers
        Number of processes.
    chunk
        Runs of one case that a process takes at once.
    resume
        Keep the rows that the folder holds.
    on_progress
        Called with runs done and runs in all.

    Raises
    ------
    DataError
        If the folder holds a study and ``resume`` is not set, or it holds a different one.
    """
    import joblib

    kept = _open(folder, cases, resume)
    wanted = {(case.label, index) for case in cases for index in range(runs)}
    found = {key: row for key, row in kept.items() if key in wanted}
    chunks = []
    for case in cases:
        missing = [index for index in range(runs) if (case.label, index) not in found]
        chunks += [(case, missing[at : at + chunk]) for at in range(0, len(missing), chunk)]
    on_progress(len(found), len(wanted))
    with (
        (folder / "rows.jsonl").open("a", encoding="utf-8") as file,
        joblib.parallel_config("loky", n_jobs=workers, inner_max_num_threads=1),
    ):
        pool = joblib.Parallel(return_as="generator_unordered", batch_size=1)
        for rows in pool(joblib.delayed(_run_chunk)(*each) for each in chunks):
            file.writelines(json.dumps(row) + "\n" for row in rows)
            file.flush()
            os.fsync(file.fileno())
            found |= {(row["case"], row["index"]): row for row in rows}
            on_progress(len(found), len(wanted))
    ordered = [found[key] for key in sorted(found)]
    write_csv(folder / "rows.csv", COLUMNS, ([row[c] for c in COLUMNS] for row in ordered))
    return ordered


def _run_chunk(case: Case, indices: Sequence[int]) -> list[Row]:
    return [run(case, index) for index in indices]


def _open(folder: Path, cases: Sequence[Case], resume: bool) -> dict[tuple[str, int], Row]:
    """Return the rows that count already; what a torn last line held is run again."""
    described = [
        {
            "label": case.label,
            "way": case.way,
            "duration_s": case.duration_s,
            "model": sha256(case.model),
            "config": case.config.model_dump(mode="json"),
        }
        for case in cases
    ]
    said, rows = folder / "study.json", folder / "rows.jsonl"
    if not said.exists():
        write_json(said, described)
        return {}
    if not resume:
        raise DataError(f"{folder}: holds a study already; go on with --resume or choose --out")
    if json.loads(said.read_text(encoding="utf-8")) != described:
        raise DataError(f"{folder}: holds a study with other settings; choose another with --out")
    whole, _, torn = (rows.read_bytes() if rows.exists() else b"").rpartition(b"\n")
    if torn:
        with replacing(rows) as file:
            file.write(whole + b"\n" if whole else b"")
    parsed = [json.loads(line) for line in whole.splitlines()]
    return {(row["case"], row["index"]): row for row in parsed}

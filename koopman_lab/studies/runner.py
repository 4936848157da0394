"""Runs a study, and goes on where it was interrupted.

Rows are appended to ``rows.jsonl`` as they come; everything else is made from all of them in the
end, sorted, and so does not depend on who ran what and when.
"""

from __future__ import annotations

import contextlib
import fcntl
import hashlib
import json
import os
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from importlib.metadata import version
from pathlib import Path
from typing import Any

from koopman_lab.errors import DataError, LabStateError
from koopman_lab.figures.distribution_figure import draw_distribution
from koopman_lab.files import write_csv, write_json, writing_where_named
from koopman_lab.json_file import JsonTable, Refusal, read_table
from koopman_lab.studies import deviation_table, result_cache
from koopman_lab.studies.parking import COLUMNS, Case
from koopman_lab.studies.pools import Chunk, ChunkResult, Pool, WorkerLostError

Row = dict[str, Any]
MOST_POOLS = 4
"""After so many pools have lost a process, something kills them all."""


@dataclass(frozen=True)
class Study:
    """What is to be run.

    Attributes
    ----------
    name
        Name of the study.
    cases
        The cases, with different labels.
    runs
        Number of runs of each case, from start 0 on.
    facts
        What else was asked, JSON: a study goes on only if it is the same.
    """

    name: str
    cases: Sequence[Case]
    runs: int
    facts: dict[str, Any] = field(default_factory=dict)

    def described(self) -> dict[str, Any]:
        """Return what ``study.json`` says."""
        of_cases = [
            {
                "label": case.label,
                "way": case.way,
                "duration_s": case.duration_s,
                "model": hashlib.sha256(case.model).hexdigest() if case.model else None,
                "refused": case.refused or None,
                "config": case.config.model_dump(mode="json"),
            }
            for case in self.cases
        ]
        return {"study": self.name, "runs": self.runs} | self.facts | {"cases": of_cases}


def run_study(
    folder: Path,
    study: Study,
    pool: Pool,
    chunk: int = 5,
    resume: bool = False,
    on_progress: Callable[[int, int, float], None] = lambda _done, _total, _rate: None,
    on_loss: Callable[[int], None] = lambda _left: None,
) -> list[Row]:
    """Run every case from every start; return all rows, sorted, and leave the study's files.

    Parameters
    ----------
    folder
        Folder of the study.
    study
        The study.
    pool
        Who runs it.
    chunk
        Runs of one case that are handed out at once.
    resume
        Keep the rows that the folder holds.
    on_progress
        Called with runs done, runs in all, and runs per second since the call.
    on_loss
        Called when a process died, with the number of pools that may still begin.

    Raises
    ------
    DataError
        If the folder holds a study and ``resume`` is not set, or it holds a different one.
    NotWrittenError
        If the folder cannot be written.
    LabStateError
        If another command is at work in the folder, or the pool cannot go on; what was done is
        kept.
    """
    began_s, solvers = time.perf_counter(), set()
    with _locked(folder):
        rows_by_key = _completed_rows(folder, study, resume)
        keys = {(case.label, index) for case in study.cases for index in range(study.runs)}
        count_before, lost = len(rows_by_key.keys() & keys), 0
        on_progress(count_before, len(keys), 0.0)
        with (folder / "rows.jsonl").open("a", encoding="utf-8") as file:
            while chunks := _missing(study, rows_by_key, chunk):
                for chunk_result in _safely(pool, chunks, folder):
                    if chunk_result is None:
                        lost += 1
                        on_loss(MOST_POOLS - lost)
                        break
                    file.writelines(map(result_cache.line_of, chunk_result.rows))
                    file.flush()
                    os.fsync(file.fileno())
                    rows_by_key |= {(row["case"], row["index"]): row for row in chunk_result.rows}
                    solvers |= {chunk_result.solver} - {""}
                    count = len(rows_by_key.keys() & keys)
                    on_progress(
                        count, len(keys), (count - count_before) / (time.perf_counter() - began_s)
                    )
                if lost == MOST_POOLS:
                    raise LabStateError(
                        f"{folder}: {lost} times a process of the pool was killed; see whether "
                        "memory is short (fewer --workers), then go on with --resume"
                    )
        ordered = [rows_by_key[key] for key in sorted(keys)]
        elapsed_s = time.perf_counter() - began_s
        _write(folder, study, ordered)
        _summarise(folder, study, ordered, pool, elapsed_s, len(keys) - count_before, lost, solvers)
        _draw(folder, study, ordered)
    return ordered


def _safely(pool: Pool, chunks: Sequence[Chunk], folder: Path) -> Iterator[ChunkResult | None]:
    """Yield what chunks brought, and None in the end if the pool lost a process."""
    try:
        yield from pool(chunks)
    except WorkerLostError:
        yield None
    except LabStateError as error:
        raise LabStateError(
            f"{error}\nwhat is done is kept: go on with --resume --out {folder}"
        ) from None


def _missing(study: Study, rows_by_key: dict[tuple[str, int], Row], chunk: int) -> list[Chunk]:
    chunks: list[Chunk] = []
    for case in study.cases:
        missing = [i for i in range(study.runs) if (case.label, i) not in rows_by_key]
        chunks += [
            (case, missing[first : first + chunk]) for first in range(0, len(missing), chunk)
        ]
    return chunks


def _write(folder: Path, study: Study, rows: Sequence[Row]) -> None:
    labels = [case.label for case in study.cases]
    write_csv(folder / "rows.csv", COLUMNS, ([row[c] for c in COLUMNS] for row in rows))
    write_csv(
        folder / "table.csv", deviation_table.COLUMNS, deviation_table.deviation_table(rows, labels)
    )


def _draw(folder: Path, study: Study, rows: Sequence[Row]) -> None:
    panels: dict[str, list[str]] = {}
    for case in study.cases:
        title = f"{case.config.robot.kind} robot, after {case.duration_s:g} s"
        panels.setdefault(title, []).append(case.label)
    draw_distribution(folder / "distribution", panels, deviation_table.deviations_mm(rows))


def _summarise(
    folder: Path,
    study: Study,
    rows: Sequence[Row],
    pool: Pool,
    elapsed_s: float,
    runs_done: int,
    lost: int,
    solvers: set[str],
) -> None:
    of_cases = {}
    for case in study.cases:
        case_rows = [row for row in rows if row["case"] == case.label]
        run_s = sum(row["run_s"] for row in case_rows)
        of_cases[case.label] = {
            "runs": len(case_rows),
            "failed": sum(row["reason"] is not None for row in case_rows),
            "run_s": run_s,
            "solving_s": sum(row["solving_s"] for row in case_rows),
            "runs_per_second_of_a_worker": len(case_rows) / run_s if run_s else None,
        }
    write_json(
        folder / "summary.json",
        {
            "what": f"study {study.name}",
            "runs": len(rows),
            "runs_of_this_command": runs_done,
            "wall_clock_s": elapsed_s,
            "runs_per_second": runs_done / elapsed_s,
            "where": pool.where,
            "workers": pool.workers,
            "pools_lost": lost,
            "solvers": sorted(solvers),
            "solving_s": sum(facts["solving_s"] for facts in of_cases.values()),
            "rest_of_the_runs_s": sum(
                facts["run_s"] - facts["solving_s"] for facts in of_cases.values()
            ),
            "cases": of_cases,
            "version": version("koopman-lab"),
        },
    )


@contextlib.contextmanager
def _locked(folder: Path) -> Iterator[None]:
    """Keep others out of the folder; a lock ends with its process, however that ends."""
    with writing_where_named(folder):
        folder.mkdir(parents=True, exist_ok=True)
        file = (folder / "rows.jsonl").open("ab")
    with file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise LabStateError(
                f"{folder}: another `klab study` is at work in it; let it end, or end it first"
            ) from None
        yield


def _completed_rows(folder: Path, study: Study, resume: bool) -> dict[tuple[str, int], Row]:
    """Return the rows that count already; what damaged lines held is run again."""
    # As JSON gives it back: tuples are lists there.
    requested = json.loads(json.dumps(study.described()))
    description, rows_file = folder / "study.json", folder / "rows.jsonl"
    if not description.exists():
        write_json(description, requested)
        return {}
    if not resume:
        raise DataError(f"{folder}: holds a study already; go on with --resume or choose --out")
    refusal = Refusal(description, "a study", "choose another folder with --out", DataError)
    recorded = read_table(refusal, JsonTable).model_dump()
    if recorded | {"runs": study.runs} != requested:
        raise DataError(f"{folder}: holds a study with other settings; choose another with --out")
    if recorded != requested:
        write_json(description, requested)
    rows = result_cache.whole_rows(rows_file, set(COLUMNS))
    return {(row["case"], row["index"]): row for row in rows}

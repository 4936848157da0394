"""What the studies of random starts share: models, the pool of processes, progress, the table."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import typer

from koopman_lab.errors import DataError
from koopman_lab.robots.table import robot_type
from offboard.lab.run_folder import run_path
from offboard.terminal import options
from offboard.terminal.exit_codes import ExitCode
from offboard.terminal.output import err, out, progress

if TYPE_CHECKING:
    from koopman_lab.config.schema import LabConfig
    from koopman_lab.data.dataset import DataSet
    from koopman_lab.studies.parking import Case
    from koopman_lab.studies.pools import Pool
    from koopman_lab.studies.runner import Study
    from koopman_lab.studies.trained_models import Recipe


class RunPlan(NamedTuple):
    """How a study is run: who runs it, where its files are, and whether it goes on."""

    folder: Path
    runs: int
    chunk: int
    resume: bool
    pool: Callable[[], Pool]


def run_plan(
    name: str,
    folder: Path | None,
    runs: int,
    chunk: int,
    resume: bool,
    workers: int | None,
    dask: str | None,
) -> RunPlan:
    """Return how a study is run, from what was typed.

    Raises
    ------
    DataError
        If the options contradict each other.
    """
    if resume and folder is None:
        raise DataError("--resume: say with --out which study goes on")
    if dask is not None and workers is not None:
        raise DataError(
            "--dask: the scheduler says how many workers there are; leave --workers out"
        )

    def pool() -> Pool:
        import joblib

        from koopman_lab.studies.pools import Cluster, Processes
        from offboard.commands.studies.interrupts import interrupts_held_back

        if dask is not None:
            return Cluster(dask)
        return Processes(workers or joblib.cpu_count(), interrupts_held_back)

    return RunPlan(run_path(folder, name), runs, chunk, resume, pool)


def lab_of_model(
    model: Path,
    kind: str | None,
    config: Path | None,
    overrides: Sequence[str] | None,
    seed: int | None,
) -> tuple[LabConfig, bytes]:
    """Return the lab at the model's sampling time, and what the model's file holds."""
    from koopman_lab.predictors.predictor import require_robot
    from koopman_lab.predictors.table import load_model

    loaded = load_model(model)
    changes = [f"controller.dt_s={loaded.dt_s}", *(overrides or ())]
    lab = options.resolve(
        config, changes, kind or (None if config else loaded.robot.name), seed=seed
    )
    require_robot(loaded, lab.robot.kind)
    return lab, model.read_bytes()


def open_dataset(source: Path, kind: str | None) -> tuple[DataSet, str]:
    """Return a data set, at the paper's sampling time, and the dictionary for it."""
    from koopman_lab.data.source import open_source

    read = open_source(source, robot_kind=kind)
    is_session = read.file.is_file() and read.file != source
    dt_s = robot_type(read.dataset.robot_kind).runs.study_dt_s
    if is_session and dt_s is not None:
        read = open_source(source, dt_s=dt_s)
    return read.dataset, read.dictionary


def trained_cases(
    recipes: dict[str, Recipe],
    dataset: DataSet,
    dictionary: str,
    overrides: Sequence[str] | None,
    seed: int | None,
    plan: RunPlan,
) -> list[Case]:
    """Return a case for each model, trained into the study's folder or refused.

    Raises
    ------
    LabError
        If a model of a study that goes on is missing, or the folder cannot be written.
    """
    from koopman_lab.studies import trained_models as models
    from koopman_lab.studies.parking import Case

    kind = dataset.robot_kind
    changes = [f"controller.dt_s={dataset.dt_s}", *(overrides or ())]
    lab = options.resolve(None, changes, kind, seed=seed)
    seconds = robot_type(kind).runs.simulate_s
    goes_on = plan.resume and (plan.folder / "study.json").exists()
    cases = []
    for label, recipe in recipes.items():
        file = plan.folder / "models" / f"{label}.npz"
        content, refused = models.trained(file, recipe, dataset, dictionary, lab.seed, keep=goes_on)
        if refused:
            err.print(f"{label}: no model ({refused})")
        cases.append(Case(label, lab, "reprojected", seconds, content, refused))
    return cases


def run_and_show(
    name: str, cases: Sequence[Case], plan: RunPlan, facts: dict[str, Any] | None = None
) -> None:
    """Run a study to its end and print its table.

    Raises
    ------
    LabError
        If the folder cannot be used, or whoever runs it is gone for good.
    """
    from koopman_lab.studies.runner import Study, run_study

    study = Study(name, cases, plan.runs, facts or {})
    pool = plan.pool()
    with _keeping_the_rows(plan.folder), progress(name, "runs") as report:
        rows = run_study(
            plan.folder,
            study,
            pool,
            plan.chunk,
            plan.resume,
            lambda done, total, rate: report(done, total, f"{rate:.1f} runs/s"),
            lambda left: err.print(
                "a process was killed; what it was at is run again"
                + (f" (not more than {left} times)" if left else "")
            ),
        )
    _show(study, rows)
    err.print(f"figure: {plan.folder / 'distribution.png'}")


@contextlib.contextmanager
def _keeping_the_rows(folder: Path) -> Iterator[None]:
    """End the command after Ctrl-C inside the block, and say how the study goes on."""
    try:
        yield
    except KeyboardInterrupt:
        err.print(
            f"interrupted; what is done is kept: the same command with --resume --out {folder} "
            "goes on"
        )
        raise typer.Exit(ExitCode.INTERRUPTED) from None


def _show(study: Study, rows: Sequence[dict[str, Any]]) -> None:
    from rich.table import Table

    from koopman_lab.studies.deviation_table import COLUMNS, deviation_table

    columns = ("p25_mm", "p50_mm", "p75_mm", "p95_mm", "max_mm")
    shown = Table(box=None, pad_edge=False, title=f"{study.name}: |x2| at the end (mm)")
    shown.add_column("case", no_wrap=True)
    for column in ("runs", "failed", "25 %", "50 %", "75 %", "95 %", "max", "< 2 mm"):
        shown.add_column(column, justify="right", no_wrap=True)
    for line in deviation_table(rows, [case.label for case in study.cases]):
        values = dict(zip(COLUMNS, line, strict=True))
        shown.add_row(
            values["case"],
            str(values["runs"]),
            str(values["failed"]),
            *(f"{values[column]:.3g}" for column in columns),
            f"{100.0 * values['share_below_2_mm']:.0f} %",
        )
    out.print(shown)

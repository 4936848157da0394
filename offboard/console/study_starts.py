"""`klab study`: the studies that meet the robot at random starts."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import typer

from koopman_lab.config.schema import LabConfig, RobotKind
from koopman_lab.errors import DataError
from offboard.console import options
from offboard.console.folder import run_path
from offboard.console.simulate import DURATIONS_S
from offboard.console.terminal import err, out, progress

if TYPE_CHECKING:
    from koopman_lab.data.dataset import DataSet
    from koopman_lab.studies.models import Recipe
    from koopman_lab.studies.parking import Case
    from koopman_lab.studies.pools import Pool
    from koopman_lab.studies.runner import Study

SLOW_DT_S = 0.1
"""Sampling time of the kinematic robot's simulations, section 4 of the paper."""
HORIZONS = range(10, 101, 10)

Model = Annotated[Path, typer.Option("--model", metavar="FILE", help="From `klab train`.")]
Source = Annotated[
    Path,
    typer.Option(
        "--dataset",
        metavar="SOURCE",
        help="A session, or a data set .npz of one; a kinematic session is sampled every 0.1 s.",
    ),
]
Runs = Annotated[int, typer.Option("--runs", min=1, help="Starts; each controller meets all.")]
Workers = Annotated[
    int | None, typer.Option("--workers", min=1, help="Processes; default: one for each core.")
]
Chunk = Annotated[int, typer.Option("--chunk", min=1, help="Runs handed out at once.")]
Dask = Annotated[
    str | None,
    typer.Option(
        "--dask",
        metavar="ADDRESS",
        help="Run on the workers of this scheduler, e.g. tcp://127.0.0.1:8786.",
    ),
]
Resume = Annotated[bool, typer.Option("--resume", help="Go on with the study in --out DIR.")]


class How(NamedTuple):
    """How a study is run: who runs it, where its files are, and whether it goes on."""

    folder: Path
    runs: int
    chunk: int
    resume: bool
    pool: Callable[[], Pool]


def kinematic_parking(
    model: Model,
    runs: Runs = 1000,
    seed: options.Seed = None,
    workers: Workers = None,
    chunk: Chunk = 5,
    dask: Dask = None,
    resume: Resume = False,
    config: options.ConfigFile = None,
    overrides: options.Overrides = None,
    folder: options.Out = None,
) -> None:
    """Park the kinematic robot from random poses with every controller; |x2| after 10 s.

    DIR gets rows.csv, table.csv and the distribution functions (section 4 of the paper).

    Example: klab study kinematic-parking --model runs/slow.npz --runs 100 --out runs/parking
    """
    how = _how("kinematic-parking", folder, runs, chunk, resume, workers, dask)
    _parking("kinematic-parking", "kinematic", model, how, config, overrides, seed)


def dynamic_parking(
    model: Model,
    runs: Runs = 1000,
    seed: options.Seed = None,
    workers: Workers = None,
    chunk: Chunk = 5,
    dask: Dask = None,
    resume: Resume = False,
    config: options.ConfigFile = None,
    overrides: options.Overrides = None,
    folder: options.Out = None,
) -> None:
    """Park the second-order robot from random poses in X0, at rest; |x2| after 20 s.

    DIR gets rows.csv, table.csv and the distribution functions (section 5.4 of the paper).

    Example: klab study dynamic-parking --model runs/dynamic.npz --runs 100 --out runs/parking
    """
    how = _how("dynamic-parking", folder, runs, chunk, resume, workers, dask)
    _parking("dynamic-parking", "dynamic", model, how, config, overrides, seed)


def horizon(
    model: Model,
    runs: Runs = 1000,
    seed: options.Seed = None,
    workers: Workers = None,
    chunk: Chunk = 5,
    dask: Dask = None,
    resume: Resume = False,
    config: options.ConfigFile = None,
    overrides: options.Overrides = None,
    folder: options.Out = None,
) -> None:
    """Park from random poses with horizons of 10 to 100 sampling times.

    Example: klab study horizon --model runs/dynamic.npz --runs 100 --out runs/horizon
    """
    from koopman_lab.studies.parking import Case, with_controller

    how = _how("horizon", folder, runs, chunk, resume, workers, dask)
    lab, content = _with_model(model, None, config, overrides, seed)
    seconds = DURATIONS_S[lab.robot.kind]
    cases = [
        Case(f"h{steps}", with_controller(lab, horizon=steps), "reprojected", seconds, content)
        for steps in HORIZONS
    ]
    _run("horizon", cases, how)


def data_efficiency(
    kinematic: Annotated[
        Path | None,
        typer.Option(
            "--dataset-kinematic",
            metavar="SOURCE",
            help="A session, sampled every 0.1 s, or a data set .npz.",
        ),
    ] = None,
    dynamic: Annotated[
        Path | None,
        typer.Option("--dataset-dynamic", metavar="SOURCE", help="A session, or a data set .npz."),
    ] = None,
    runs: Runs = 1000,
    seed: options.Seed = None,
    workers: Workers = None,
    chunk: Chunk = 5,
    dask: Dask = None,
    resume: Resume = False,
    folder: options.Out = None,
) -> None:
    """Park with models of 5, 10, ... 2000 and all samples per basis input (section 6).

    The samples are drawn across the runs of the session; DIR/models holds the models.

    Example: klab study data-efficiency --dataset-dynamic runs/dynamic --runs 100 --out runs/few
    """
    from koopman_lab.studies.models import by_count

    sources: list[tuple[RobotKind, Path | None]] = [("kinematic", kinematic), ("dynamic", dynamic)]
    if not any(source for _, source in sources):
        raise DataError("name a session with --dataset-kinematic, --dataset-dynamic, or both")
    how = _how("data-efficiency", folder, runs, chunk, resume, workers, dask)
    cases: list[Case] = []
    facts: dict[str, Any] = {}
    for kind, source in sources:
        if source is None:
            continue
        dataset, dictionary = _opened(source, kind)
        recipes = {f"{kind}-{label}": recipe for label, recipe in by_count().items()}
        cases += _trained(recipes, dataset, dictionary, seed, how)
        facts[f"data_{kind}"] = dataset.data_hash
    _run("data-efficiency", cases, how, facts)


def combination(
    source: Source,
    runs: Runs = 1000,
    seed: options.Seed = None,
    workers: Workers = None,
    chunk: Chunk = 5,
    dask: Dask = None,
    resume: Resume = False,
    dictionary: options.Dictionary = None,
    folder: options.Out = None,
) -> None:
    """Park with models that combine inputs as the paper does, and by their generators.

    Example: klab study combination --dataset runs/dynamic --runs 100 --out runs/combination
    """
    from koopman_lab.koopman.train import Method
    from koopman_lab.studies.models import Recipe

    recipes = {
        "paper": Recipe(method=Method(combination="paper")),
        "generator": Recipe(method=Method(combination="generator")),
    }
    how = _how("combination", folder, runs, chunk, resume, workers, dask)
    _methods("combination", recipes, source, dictionary, seed, how)


def fit(
    source: Source,
    runs: Runs = 1000,
    seed: options.Seed = None,
    workers: Workers = None,
    chunk: Chunk = 5,
    dask: Dask = None,
    resume: Resume = False,
    dictionary: options.Dictionary = None,
    folder: options.Out = None,
) -> None:
    """Park with models of plain, noise-aware and symmetric fits.

    Example: klab study fit --dataset runs/dynamic --runs 100 --out runs/fit
    """
    from koopman_lab.koopman.needed import METHODS
    from koopman_lab.studies.models import Recipe

    recipes = {name: Recipe(method=METHODS[name]) for name in ("plain", "noise-aware", "symmetric")}
    how = _how("fit", folder, runs, chunk, resume, workers, dask)
    _methods("fit", recipes, source, dictionary, seed, how)


COMMANDS = (kinematic_parking, dynamic_parking, data_efficiency, horizon, combination, fit)


def _how(
    name: str,
    folder: Path | None,
    runs: int,
    chunk: int,
    resume: bool,
    workers: int | None,
    dask: str | None,
) -> How:
    if resume and folder is None:
        raise DataError("--resume: say with --out which study goes on")
    if dask is not None and workers is not None:
        raise DataError(
            "--dask: the scheduler says how many workers there are; leave --workers out"
        )

    def pool() -> Pool:
        import joblib

        from koopman_lab.studies.pools import Cluster, Processes

        return Processes(workers or joblib.cpu_count()) if dask is None else Cluster(dask)

    return How(run_path(folder, name), runs, chunk, resume, pool)


def _with_model(
    model: Path,
    kind: RobotKind | None,
    config: Path | None,
    overrides: Sequence[str] | None,
    seed: int | None,
) -> tuple[LabConfig, bytes]:
    """Return the lab at the model's sampling time, and what the model's file holds."""
    from koopman_lab.koopman.model import BilinearModel

    loaded = BilinearModel.load(model)
    wanted = [f"controller.dt_s={loaded.dt_s}", *(overrides or ())]
    lab = options.resolve(
        config, wanted, kind or (None if config else loaded.robot_kind), seed=seed
    )
    loaded.require_robot(lab.robot.kind)
    return lab, model.read_bytes()


def _parking(
    name: str,
    kind: RobotKind,
    model: Path,
    how: How,
    config: Path | None,
    overrides: Sequence[str] | None,
    seed: int | None,
) -> None:
    from koopman_lab.studies.parking import cases

    lab, content = _with_model(model, kind, config, overrides, seed)
    _run(name, cases(lab, content, DURATIONS_S[kind]), how)


def _methods(
    name: str,
    recipes: dict[str, Recipe],
    source: Path,
    dictionary: str | None,
    seed: int | None,
    how: How,
) -> None:
    dataset, own = _opened(source, None)
    cases = _trained(recipes, dataset, dictionary or own, seed, how)
    _run(name, cases, how, {"data": dataset.data_hash})


def _opened(source: Path, kind: RobotKind | None) -> tuple[DataSet, str]:
    """Return a data set, at the paper's sampling time, and the dictionary for it."""
    from koopman_lab.data.source import open_source

    opened = open_source(source, robot_kind=kind)
    session = opened.file.is_file() and opened.file != source
    if session and opened.dataset.robot_kind == "kinematic":
        opened = open_source(source, dt_s=SLOW_DT_S)
    return opened.dataset, opened.dictionary


def _trained(
    recipes: dict[str, Recipe], dataset: DataSet, dictionary: str, seed: int | None, how: How
) -> list[Case]:
    from koopman_lab.studies.models import trained
    from koopman_lab.studies.parking import Case

    kind = dataset.robot_kind
    wanted = [f"controller.dt_s={dataset.dt_s}"]
    lab = options.resolve(None, wanted, kind, seed=seed)
    goes_on = how.resume and (how.folder / "study.json").exists()
    cases = []
    for label, recipe in recipes.items():
        file = how.folder / "models" / f"{label}.npz"
        content, refused = trained(file, recipe, dataset, dictionary, lab.seed, keep=goes_on)
        if refused:
            err.print(f"{label}: no model ({refused})", markup=False)
        cases.append(Case(label, lab, "reprojected", DURATIONS_S[kind], content, refused))
    return cases


def _run(name: str, cases: Sequence[Case], how: How, facts: dict[str, Any] | None = None) -> None:
    from koopman_lab.studies.runner import Study, run_study

    study = Study(name, cases, how.runs, facts or {})
    pool = how.pool()
    with progress(name, "runs") as report:
        rows = run_study(
            how.folder,
            study,
            pool,
            how.chunk,
            how.resume,
            lambda done, total, rate: report(done, total, f"{rate:.1f} runs/s"),
            lambda left: err.print(
                "a process was killed; what it was at is run again"
                + (f" (not more than {left} times)" if left else "")
            ),
        )
    _show(study, rows)
    err.print(f"figure: {how.folder / 'distribution.png'}")


def _show(study: Study, rows: Sequence[dict[str, Any]]) -> None:
    from rich.table import Table

    from koopman_lab.studies.table import COLUMNS, table

    columns = ("p25_mm", "p50_mm", "p75_mm", "p95_mm", "max_mm")
    shown = Table(box=None, pad_edge=False, title=f"{study.name}: |x2| at the end (mm)")
    shown.add_column("case", no_wrap=True)
    for column in ("runs", "failed", "25 %", "50 %", "75 %", "95 %", "max", "< 2 mm"):
        shown.add_column(column, justify="right", no_wrap=True)
    for line in table(rows, [case.label for case in study.cases]):
        of = dict(zip(COLUMNS, line, strict=True))
        shown.add_row(
            of["case"],
            str(of["runs"]),
            str(of["failed"]),
            *(f"{of[column]:.3g}" for column in columns),
            f"{100.0 * of['share_below_2_mm']:.0f} %",
        )
    out.print(shown)

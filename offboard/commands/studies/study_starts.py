"""`klab study`: the studies that meet the robot at random starts."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from koopman_lab.errors import DataError
from koopman_lab.robots.dynamic import DYNAMIC
from koopman_lab.robots.kinematic import KINEMATIC
from koopman_lab.robots.table import robot_type
from offboard.commands.studies.study_run import (
    RunPlan,
    lab_of_model,
    open_dataset,
    run_and_show,
    run_plan,
    trained_cases,
)
from offboard.terminal import options
from offboard.terminal.needs import needs

if TYPE_CHECKING:
    from koopman_lab.studies.parking import Case
    from koopman_lab.studies.trained_models import Recipe

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


@needs("cluster", "--dask", lambda options: options["dask"])
@needs("desk")
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
    plan = run_plan(f"{KINEMATIC.name}-parking", folder, runs, chunk, resume, workers, dask)
    _run_parking(f"{KINEMATIC.name}-parking", KINEMATIC.name, model, plan, config, overrides, seed)


@needs("cluster", "--dask", lambda options: options["dask"])
@needs("desk")
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
    plan = run_plan(f"{DYNAMIC.name}-parking", folder, runs, chunk, resume, workers, dask)
    _run_parking(f"{DYNAMIC.name}-parking", DYNAMIC.name, model, plan, config, overrides, seed)


@needs("cluster", "--dask", lambda options: options["dask"])
@needs("desk")
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

    plan = run_plan("horizon", folder, runs, chunk, resume, workers, dask)
    lab, content = lab_of_model(model, None, config, overrides, seed)
    seconds = robot_type(lab.robot.kind).runs.simulate_s
    cases = [
        Case(f"h{steps}", with_controller(lab, horizon=steps), "reprojected", seconds, content)
        for steps in HORIZONS
    ]
    run_and_show("horizon", cases, plan)


@needs("cluster", "--dask", lambda options: options["dask"])
@needs("desk")
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
    overrides: options.Overrides = None,
    folder: options.Out = None,
) -> None:
    """Park with models of 5, 10, ... 2000 and all samples per basis input (section 6).

    The samples are drawn across the runs of the session; DIR/models holds the models.

    Example: klab study data-efficiency --dataset-dynamic runs/dynamic --runs 100 --out runs/few
    """
    from koopman_lab.studies.trained_models import by_count

    sources = {KINEMATIC.name: kinematic, DYNAMIC.name: dynamic}
    if not any(sources.values()):
        raise DataError("name a session with --dataset-kinematic, --dataset-dynamic, or both")
    plan = run_plan("data-efficiency", folder, runs, chunk, resume, workers, dask)
    cases: list[Case] = []
    facts: dict[str, Any] = {}
    for kind, source in sources.items():
        if source is None:
            continue
        dataset, dictionary = open_dataset(source, kind)
        recipes = {f"{kind}-{label}": recipe for label, recipe in by_count().items()}
        cases += trained_cases(recipes, dataset, dictionary, overrides, seed, plan)
        facts[f"data_{kind}"] = dataset.data_hash
    run_and_show("data-efficiency", cases, plan, facts)


@needs("cluster", "--dask", lambda options: options["dask"])
@needs("desk")
def combination(
    source: Source,
    runs: Runs = 1000,
    seed: options.Seed = None,
    workers: Workers = None,
    chunk: Chunk = 5,
    dask: Dask = None,
    resume: Resume = False,
    dictionary: options.Dictionary = None,
    overrides: options.Overrides = None,
    folder: options.Out = None,
) -> None:
    """Park with models that combine inputs as the paper does, and by their generators.

    Example: klab study combination --dataset runs/dynamic --runs 100 --out runs/combination
    """
    from koopman_lab.koopman.training_report import Method
    from koopman_lab.studies.trained_models import Recipe

    recipes = {
        "paper": Recipe(method=Method(combination="paper")),
        "generator": Recipe(method=Method(combination="generator")),
    }
    plan = run_plan("combination", folder, runs, chunk, resume, workers, dask)
    _run_methods("combination", recipes, source, dictionary, overrides, seed, plan)


@needs("cluster", "--dask", lambda options: options["dask"])
@needs("desk")
def fit(
    source: Source,
    runs: Runs = 1000,
    seed: options.Seed = None,
    workers: Workers = None,
    chunk: Chunk = 5,
    dask: Dask = None,
    resume: Resume = False,
    dictionary: options.Dictionary = None,
    overrides: options.Overrides = None,
    folder: options.Out = None,
) -> None:
    """Park with models of plain, noise-aware and symmetric fits.

    Example: klab study fit --dataset runs/dynamic --runs 100 --out runs/fit
    """
    from koopman_lab.evaluation.samples_needed import METHODS
    from koopman_lab.studies.trained_models import Recipe

    recipes = {name: Recipe(method=METHODS[name]) for name in ("plain", "noise-aware", "symmetric")}
    plan = run_plan("fit", folder, runs, chunk, resume, workers, dask)
    _run_methods("fit", recipes, source, dictionary, overrides, seed, plan)


COMMANDS = (kinematic_parking, dynamic_parking, data_efficiency, horizon, combination, fit)


def _run_parking(
    name: str,
    kind: str,
    model: Path,
    plan: RunPlan,
    config: Path | None,
    overrides: Sequence[str] | None,
    seed: int | None,
) -> None:
    from koopman_lab.studies.parking import cases

    lab, content = lab_of_model(model, kind, config, overrides, seed)
    run_and_show(name, cases(lab, content, robot_type(kind).runs.simulate_s), plan)


def _run_methods(
    name: str,
    recipes: dict[str, Recipe],
    source: Path,
    dictionary: str | None,
    overrides: Sequence[str] | None,
    seed: int | None,
    plan: RunPlan,
) -> None:
    dataset, default_dictionary = open_dataset(source, None)
    cases = trained_cases(recipes, dataset, dictionary or default_dictionary, overrides, seed, plan)
    run_and_show(name, cases, plan, {"data": dataset.data_hash})

"""`klab train`: from a session log or a data set to a model."""

from __future__ import annotations

import json
from collections.abc import Sequence
from enum import Enum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from koopman_lab.errors import LabError, ModelError
from koopman_lab.files import writing_where_named
from offboard.commands.data.marker_line import marker_line
from offboard.commands.data.model_info import lines
from offboard.terminal import options
from offboard.terminal.choices import name_option
from offboard.terminal.needs import needs
from offboard.terminal.output import err, out, show_passed_over, show_verdicts

if TYPE_CHECKING:
    from koopman_lab.koopman.training_report import Method, TrainingReport


class EstimatorName(str, Enum):
    """Choices of ``--estimator``."""

    plain = "plain"
    iv = "iv"


class CombinationName(str, Enum):
    """Choices of ``--combination``."""

    paper = "paper"
    generator = "generator"


def _predictors() -> Sequence[str]:
    """Return the choices of ``--predictor``."""
    from koopman_lab.predictors.table import PREDICTORS

    return PREDICTORS.names()


@needs("desk")
def train(
    sources: Annotated[
        list[Path],
        typer.Argument(
            metavar="SOURCE...",
            help="Sessions, data sets .npz, or folders of X_i.dat and Y_i.dat; one at a time is "
            "in memory.",
        ),
    ],
    model: Annotated[
        Path | None,
        typer.Option("--out", metavar="FILE", help="Default: model.npz beside the first source."),
    ] = None,
    predictor: Annotated[
        str, name_option("--predictor", "predictor", _predictors, "What is learned.")
    ] = "edmd",
    dictionary: options.Dictionary = None,
    window: options.Window = None,
    dt_s: options.SamplingTime = None,
    robot: options.Robot = None,
    estimator: Annotated[
        EstimatorName, typer.Option("--estimator", help="iv: without the bias of camera noise.")
    ] = EstimatorName.plain,
    symmetric: Annotated[
        bool, typer.Option("--symmetric", help="Only models that moving and turning leave alike.")
    ] = False,
    ridge: Annotated[
        float, typer.Option("--ridge", min=0.0, help="Weight of a pull towards the identity.")
    ] = 0.0,
    combination: Annotated[
        CombinationName, typer.Option("--combination", help="Of inputs: matrices or generators.")
    ] = CombinationName.paper,
    overwrite: Annotated[
        bool, typer.Option("--overwrite", help="Replace a model that is there already.")
    ] = False,
    salvage: options.Salvage = False,
    as_json: options.AsJson = False,
) -> None:
    """Fit a bilinear Koopman model; prints samples, rank, condition, defects, verdicts.

    Sessions, data and model are judged, and the model keeps that: `klab park` refuses one that
    would drive the wrong way.

    With --predictor another package's model instead, which says what it makes of the other options.
    A folder of .dat files from elsewhere needs --robot and --dt. A model that is there already is
    not replaced without --overwrite.

    Example: klab train runs/calibration --window 40 --out runs/model.npz
    """
    from koopman_lab.koopman.training_report import Method

    train_and_report(
        sources,
        model,
        dictionary,
        window,
        dt_s,
        predictor=predictor,
        method=Method(estimator.value, ridge, symmetric, combination.value),
        robot_kind=robot,
        overwrite=overwrite,
        salvage=salvage,
        as_json=as_json,
    )


def train_and_report(
    sources: Sequence[Path],
    model: Path | None = None,
    dictionary: str | None = None,
    window: int | None = None,
    dt_s: float | None = None,
    *,
    predictor: str = "edmd",
    method: Method | None = None,
    robot_kind: str | None = None,
    overwrite: bool = False,
    salvage: bool = False,
    as_json: bool = False,
    silent: bool = False,
) -> Path:
    """Train, print the report and the verdicts, which the model keeps; return where it is.

    With ``silent`` nothing is printed on standard output.

    Raises
    ------
    LabError
        If a source cannot be used, or together they do not excite the dictionary.
    """
    from koopman_lab.data.source import folder_of, is_there, open_source
    from koopman_lab.evaluation.judged_training import JudgedTrainer
    from koopman_lab.koopman.training_report import TrainingReport

    trainer = JudgedTrainer(predictor, dictionary, method)
    path = model if model is not None else folder_of(sources[0]) / "model.npz"
    # Before hours of data are read, but a source that is missing comes first.
    if path.is_file() and not overwrite and all(map(is_there, sources)):
        raise ModelError(
            f"{path}: is there already; choose another file with --out, or replace it with "
            "--overwrite"
        )
    passed_over = []
    for source in sources:
        opened = open_source(
            source, robot_kind=robot_kind, dt_s=dt_s, window=window, salvage=salvage
        )
        trainer.add(opened)
        passed_over.append(opened.passed_over)
    try:
        trained = trainer.result()
    except LabError:
        for of_source in trainer.verdicts:
            show_verdicts(of_source)
        raise
    learned, report = trained.model, trained.report
    with writing_where_named(path):
        learned.save(path)
    for part in passed_over:
        show_passed_over(part)
    if as_json:
        marker = learned.metadata.get("data", {}).get("marker")
        facts = {"model": str(path), "marker": marker, "verdict": learned.metadata.get("verdict")}
        out.print_json(json.dumps(report.as_dict() | facts))
    elif not silent:
        if isinstance(report, TrainingReport):
            _show(report)
        else:
            for text in lines(report.as_dict()):
                out.print(text)
        line = marker_line(learned.metadata.get("data", {}))
        if line:
            out.print(line)
        for source, of_source in zip(sources, trainer.verdicts, strict=True):
            prefix = f"{source}, " if len(sources) > 1 else ""
            show_verdicts({f"{prefix}{name}": v for name, v in of_source.items()}, out)
        show_verdicts({"model": trained.verdict}, out)
        err.print(f"model: {path}")
    return path


def _show(report: TrainingReport) -> None:
    from rich.table import Table

    table = Table(title=f"{report.dictionary}, {report.robot} robot, dt {report.dt_s:g} s")
    for column in ("basis input", "samples", "segments", "rank", "smallest sv", "condition"):
        table.add_column(column, justify="right")
    for basis in report.bases:
        name = f"u_{basis.basis_index} = ({basis.basis_input[0]:g}, {basis.basis_input[1]:g})"
        excitation = basis.excitation
        if excitation is None:
            table.add_row(name, "driftless: M_0 = I", "", "", "", "")
        else:
            table.add_row(
                name,
                str(excitation.samples),
                str(excitation.segments),
                f"{excitation.rank} of {excitation.observables}",
                f"{excitation.smallest_singular_value:.3g}",
                f"{excitation.condition:.3g}",
            )
    out.print(table)
    method = report.method
    out.print(
        f"estimator {method.estimator}, combination {method.combination}, ridge {method.ridge:g}, "
        f"{'symmetric' if method.symmetric else 'not held symmetric'}"
    )
    weakest = [b.weakest_instrument for b in report.bases if b.weakest_instrument is not None]
    if weakest:
        out.print(f"weakest canonical correlation of instruments: {min(weakest):.3g}")
    defects = report.defects
    if defects is None:
        return
    growth = ""
    if defects.growth_per_step is not None:
        growth = (
            f"; length of (cos, sin) changes {100 * defects.growth_per_step:.3g} % per step "
            "without reprojection"
        )
    out.print(
        f"turning on the spot: {1e3 * defects.sideways_m_per_rad:.3g} mm sideways per step per "
        f"rad/s{growth}"
    )

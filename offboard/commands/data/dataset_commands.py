"""`klab dataset`: make, look into, exchange data sets."""

from __future__ import annotations

import json
from enum import Enum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from koopman_lab.errors import DataError
from koopman_lab.files import writing_where_named
from offboard.commands.data.dataset_needed import needed
from offboard.commands.data.dataset_sweep import sweep
from offboard.commands.data.marker_line import marker_line
from offboard.terminal import options
from offboard.terminal.choices import Commands
from offboard.terminal.output import err, out, show_passed_over, show_verdicts

if TYPE_CHECKING:
    from koopman_lab.data.dataset import DataSet
    from koopman_lab.data.source import Source

app = Commands(help="Make, look into, exchange data sets.", no_args_is_help=True)
app.command()(sweep)
app.command()(needed)

FromAnything = Annotated[
    Path,
    typer.Argument(
        metavar="SOURCE", help="A session, a data set .npz, or a folder of X_i.dat and Y_i.dat."
    ),
]
UNITS = {"x1": "m", "x2": "m", "theta": "rad", "v": "m/s", "omega": "rad/s"}


class Format(str, Enum):
    """Choices of ``--format``."""

    dat = "dat"
    npz = "npz"


@app.command()
def make(
    session: Annotated[
        Path, typer.Argument(metavar="SESSION_DIR_OR_LOG", help="From `klab calibrate`.")
    ],
    file: Annotated[
        Path | None,
        typer.Option("--out", metavar="FILE", help="Default: data.npz beside the log."),
    ] = None,
    window: options.Window = None,
    dt_s: options.SamplingTime = None,
    salvage: options.Salvage = False,
) -> None:
    """Make the data set of a session: pairs of states and successors for each basis input.

    Session and data are judged.

    Example: klab dataset make runs/calibration --window 40 --out runs/data.npz
    """
    from koopman_lab.data.source import open_source

    opened = open_source(session, dt_s=dt_s, window=window, salvage=salvage)
    _save(_with_origin(opened), file if file is not None else opened.folder / "data.npz")
    show_passed_over(opened.passed_over)
    _judge(opened.dataset, opened.dictionary)


@app.command()
def info(
    source: FromAnything,
    dictionary: options.Dictionary = None,
    window: options.Window = None,
    dt_s: options.SamplingTime = None,
    robot: options.Robot = None,
    salvage: options.Salvage = False,
    as_json: options.AsJson = False,
) -> None:
    """Show pairs, runs, ranges of the states, what of the dictionary they excite, and verdicts.

    Example: klab dataset info runs/calibration --dictionary D5t
    """
    from koopman_lab.data.source import open_source
    from koopman_lab.evaluation.describe import describe
    from koopman_lab.evaluation.plausibility import from_dict

    opened = open_source(source, robot_kind=robot, dt_s=dt_s, window=window, salvage=salvage)
    facts: dict[str, Any] = {"file": str(opened.file)}
    facts |= describe(opened.dataset, dictionary or opened.dictionary)
    if as_json:
        out.print_json(json.dumps(facts))
    else:
        _show(facts, marker_line(opened.dataset.metadata))
        show_verdicts({name: from_dict(v) for name, v in facts["verdicts"].items()}, out)
    show_passed_over(opened.passed_over)


@app.command()
def export(
    source: FromAnything,
    place: Annotated[
        Path, typer.Option("--out", metavar="PLACE", help="Folder of dat files, or npz file.")
    ],
    layout: Annotated[
        Format, typer.Option("--format", help="X_i.dat and Y_i.dat as published, or one npz.")
    ] = Format.dat,
    window: options.Window = None,
    robot: options.Robot = None,
    dt_s: options.SamplingTime = None,
    salvage: options.Salvage = False,
) -> None:
    """Write a data set for others: a folder of X_i.dat and Y_i.dat, a row for each pair.

    Example: klab dataset export runs/calibration --format dat --out runs/dat
    """
    from koopman_lab.data.dat import write_folder
    from koopman_lab.data.source import open_source

    opened = open_source(source, robot_kind=robot, dt_s=dt_s, window=window, salvage=salvage)
    if layout is Format.npz:
        _save(_with_origin(opened), place)
    else:
        with writing_where_named(place):
            write_folder(opened.dataset, place)
        _print_pairs(opened.dataset, place)
    show_passed_over(opened.passed_over)


@app.command("import")
def import_(
    folder: Annotated[
        Path, typer.Argument(metavar="FOLDER", help="Of X_i.dat and Y_i.dat, i the basis input.")
    ],
    robot: options.Robot = None,
    dt_s: Annotated[float | None, typer.Option("--dt", metavar="S", help="From X to Y, s.")] = None,
    config: options.ConfigFile = None,
    overrides: options.Overrides = None,
    file: Annotated[
        Path | None,
        typer.Option("--out", metavar="FILE", help="Default: FOLDER.npz beside the folder."),
    ] = None,
) -> None:
    """Make a data set of a published folder, for example of DOI 10.18419/DARUS-4538.

    Robot and sampling time are needed where the folder was not written by `klab dataset export`;
    its basis inputs are those of the configuration (sampler.basis_inputs), against which the data
    are judged.

    Example: klab dataset import runs/dat --robot kinematic --dt 0.05 --out runs/imported.npz
    """
    from koopman_lab.config.load import load_config
    from koopman_lab.data.dat import read_folder

    kind = robot
    inputs = None
    if config is not None or overrides:
        lab = options.resolve(config, overrides, kind)
        kind, inputs = lab.robot.kind, lab.sampler.indexed_inputs
    dataset = read_folder(folder, kind, dt_s, inputs)
    beside = folder.resolve()
    _save(dataset, file if file is not None else beside.with_name(f"{beside.name}.npz"))
    _judge(dataset, load_config(robot=dataset.robot_kind).model.dictionary)


def _judge(dataset: DataSet, dictionary_name: str) -> None:
    """Show the verdicts on a data set and its session."""
    from koopman_lab.evaluation.data_verdict import excitations
    from koopman_lab.evaluation.session_verdict import recorded_verdicts
    from koopman_lab.koopman.dictionary import dictionary

    observables = dictionary(dictionary_name, dataset.robot_kind)
    show_verdicts(recorded_verdicts(dataset, excitations(dataset, observables), observables))


def _with_origin(opened: Source) -> DataSet:
    """Return the data set with the file that it was made of."""
    import dataclasses

    from koopman_lab.eventlog.logwriter import files_of_log
    from koopman_lab.files import sha256

    dataset = opened.dataset
    if not opened.file.is_file() or "source" in dataset.metadata:
        return dataset
    origin = {"file": str(opened.file), "sha256": sha256(*files_of_log(opened.file))}
    return dataclasses.replace(dataset, metadata=dict(dataset.metadata) | {"source": origin})


def _save(dataset: DataSet, path: Path) -> None:
    from koopman_lab.data.source import ENDING

    if path.suffix != ENDING:
        raise DataError(f"{path}: data set files end in {ENDING}; say so with --out")
    with writing_where_named(path):
        dataset.save(path)
    _print_pairs(dataset, path)


def _print_pairs(dataset: DataSet, path: Path) -> None:
    err.print(f"{sum(map(len, dataset.X.values()))} pairs: {path}")


def _show(facts: dict[str, Any], marker: str | None) -> None:
    from rich.table import Table

    window = "" if facts["window"] is None else f", window {facts['window']}"
    out.print(
        f"{facts['file']}: {facts['pairs']} pairs, {facts['robot']} robot, dt {facts['dt_s']:g} s"
        f"{window}\ndata hash {facts['data_hash']}"
    )
    if facts["source"]:
        out.print(f"made of {facts['source']['file']}, SHA-256 {facts['source']['sha256']}")
    if marker:
        out.print(marker)
    bases = facts["basis_inputs"]
    excitation_table = Table(title=f"dictionary {facts['dictionary']}")
    for column in ("basis input", "pairs", "segments", "rank", "smallest sv", "condition"):
        excitation_table.add_column(column, justify="right")
    ranges = Table("state", title="smallest and largest value")
    for index, basis in bases.items():
        excitation = basis["excitation"]
        excitation_table.add_row(
            f"u_{index} = ({basis['input'][0]:g}, {basis['input'][1]:g})",
            str(basis["pairs"]),
            str(basis["segments"]),
            f"{excitation['rank']} of {excitation['observables']}",
            f"{excitation['smallest_singular_value']:.3g}",
            "-" if excitation["condition"] is None else f"{excitation['condition']:.3g}",
        )
        ranges.add_column(f"u_{index}", justify="right")
    for name in next(iter(bases.values()))["ranges"]:
        spans = [basis["ranges"][name] for basis in bases.values()]
        cells = ["-" if span is None else f"{span[0]:.3f} to {span[1]:.3f}" for span in spans]
        ranges.add_row(f"{name} ({UNITS[name]})", *cells)
    out.print(excitation_table, ranges)

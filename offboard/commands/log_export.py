"""`klab log plot` and `klab log export`: logs as pictures, and for other programs."""

from __future__ import annotations

from enum import Enum
from pathlib import Path
from typing import Annotated

import typer

from koopman_lab.errors import NotWrittenError
from offboard.terminal import options
from offboard.terminal.needs import needs
from offboard.terminal.output import err, show_damage, show_passed_over
from offboard.terminal.visible_text import one_line

LogFile = Annotated[Path, typer.Argument(metavar="LOG", help="A log, or its run folder.")]


class Format(str, Enum):
    """Choices of ``--format``."""

    csv = "csv"
    mcap = "mcap"


@needs("desk")
def plot(
    log: LogFile,
    file: Annotated[
        Path | None,
        typer.Option(
            "--out",
            metavar="FILE",
            help="Draw FILE.pdf and FILE.png, write CSV files; default: beside the log.",
        ),
    ] = None,
    robot_name: Annotated[
        str | None, typer.Option("--robot-name", metavar="NAME", help="Where the log has several.")
    ] = None,
    salvage: options.Salvage = False,
) -> None:
    """Draw path, speeds and commands of a log; the numbers are written as CSV beside them.

    Example: klab log plot runs/park
    """
    from koopman_lab.data.decode import SessionLog
    from koopman_lab.figures.session_figure import draw_session, session_plot

    read = SessionLog(log, robot_name=robot_name, salvage=salvage)
    stem = file if file is not None else read.path.with_name(f"{read.path.stem}-plot")
    try:
        draw_session(stem, session_plot(read))
    except OSError as error:
        raise NotWrittenError(
            f"{stem}: cannot be written ({error.strerror}); choose another with --out"
        ) from None
    show_passed_over(read.passed_over)
    err.print(f"figure: {stem.with_suffix('.png')}")


@needs("mcap", "--format mcap", lambda options: options["format_"] is Format.mcap)
def export(
    log: LogFile,
    file: Annotated[
        Path | None,
        typer.Option(
            "--out", metavar="PATH", help="Folder for CSV, file for MCAP; default: beside the log."
        ),
    ] = None,
    format_: Annotated[
        Format, typer.Option("--format", help="csv: a file a channel; mcap: one file.")
    ] = Format.csv,
    salvage: options.Salvage = False,
) -> None:
    """Write a log for other programs: CSV for PlotJuggler, MCAP for Foxglove.

    Example: klab log export runs/park --format mcap
    """
    from koopman_lab.data.export import export_csv, export_mcap
    from koopman_lab.eventlog.eventlog import Damage
    from koopman_lab.eventlog.log_name import log_file
    from koopman_lab.replay.rotated_log import read_rotated_log

    damage: list[Damage] = []
    events = read_rotated_log(log, salvage=salvage, damage=damage)
    path = log_file(log)
    ending = "-csv" if format_ is Format.csv else ".mcap"
    out = file if file is not None else path.with_name(f"{path.stem}{ending}")
    try:
        written = (export_csv if format_ is Format.csv else export_mcap)(events, out)
    except OSError as error:
        raise NotWrittenError(
            f"{out}: cannot be written ({error.strerror}); choose another with --out"
        ) from None
    show_damage(log, damage)
    for name, count in written.left_out.items():
        err.print(f"{one_line(name)}: {count} messages left out, none that this version can decode")
    err.print(
        f"{sum(written.channels.values())} messages of {len(written.channels)} channels: {out}"
    )

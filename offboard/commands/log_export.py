"""`klab log plot` and `klab log export`: logs as pictures, and for other programs."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Annotated, Any, ParamSpec

import typer

from koopman_lab.data.formats.table import FORMATS
from koopman_lab.files import writing_where_named
from offboard.terminal import options
from offboard.terminal.choices import row_option
from offboard.terminal.needs import needs
from offboard.terminal.output import err, show_damage, show_passed_over
from offboard.terminal.visible_text import one_line

P = ParamSpec("P")
LogFile = Annotated[Path, typer.Argument(metavar="LOG", help="A log, or its run folder.")]


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
    with writing_where_named(stem):
        draw_session(stem, session_plot(read))
    show_passed_over(read.passed_over)
    err.print(f"figure: {stem.with_suffix('.png')}")


def _needs_what_the_format_does(command: Callable[P, None]) -> Callable[P, None]:
    """Mark the command with the extra of each format that needs one."""
    for name in reversed(FORMATS.builtin_names()):
        row = FORMATS.builtin_row(name)
        if row is not None and row.extra:

            def chosen(arguments: Mapping[str, Any], name: str = name) -> bool:
                return bool(arguments["format_"] == name)

            command = needs(row.extra, f"--format {name}", chosen)(command)
    return command


@_needs_what_the_format_does
def export(
    log: LogFile,
    file: Annotated[
        Path | None,
        typer.Option(
            "--out", metavar="PATH", help="File or folder to write; default: beside the log."
        ),
    ] = None,
    format_: Annotated[
        str,
        row_option(
            "--format",
            FORMATS,
            "csv, parquet: a file a channel; mcap: Foxglove, in 3D; ros2: a ROS 2 bag of poses, "
            "twists, tf; mat: MATLAB.",
        ),
    ] = "csv",
    salvage: options.Salvage = False,
) -> None:
    """Write a log for other programs: PlotJuggler, Foxglove, ROS 2, MATLAB, pandas.

    Example: klab log export runs/park --format mcap
    """
    from koopman_lab.data.formats.table import writer_of
    from koopman_lab.eventlog.eventlog import Damage
    from koopman_lab.eventlog.log_name import log_file
    from koopman_lab.replay.rotated_log import read_rotated_log

    write = writer_of(format_)
    damage: list[Damage] = []
    events = read_rotated_log(log, salvage=salvage, damage=damage)
    path = log_file(log)
    out = file if file is not None else path.with_name(path.stem + FORMATS.get(format_).ending)
    with writing_where_named(out):
        written = write(events, out)
    show_damage(log, damage)
    for name, count in written.left_out.items():
        err.print(f"{one_line(name)}: {count} messages left out, none that this version can decode")
    if written.without_form:
        names = ", ".join(map(one_line, written.without_form))
        err.print(f"left out, as {format_} has no form for it: {names}")
    err.print(
        f"{sum(written.channels.values())} messages of {len(written.channels)} channels: {out}"
    )

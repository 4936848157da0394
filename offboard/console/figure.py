"""`klab figure`: figures of the paper, from what was recorded here."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from koopman_lab.errors import DataError
from offboard.console import options
from offboard.console.terminal import err, show_damage

app = typer.Typer(help="Draw figures of the paper from what was recorded.", no_args_is_help=True)

INPUT_UNITS = {"kinematic": ("m/s", "rad/s"), "dynamic": ("m/s²", "rad/s²")}


@app.callback()
def _group() -> None:
    """Keep `samples` a subcommand although it is the only one."""


@app.command()
def samples(
    session: Annotated[
        Path, typer.Argument(metavar="SESSION_DIR_OR_LOG", help="From `klab calibrate`.")
    ],
    file: Annotated[
        Path,
        typer.Option("--out", metavar="FILE", help="Draw FILE.pdf and FILE.png, write CSV files."),
    ],
    windows: Annotated[
        str, typer.Option("--windows", metavar="W,W,...", help="In frames, with commas between.")
    ] = "10,30,40,50,100",
    salvage: options.Salvage = False,
) -> None:
    """Draw the collected samples of each basis input, and velocities smoothed by several windows.

    The velocities are those of the longest segment under each input.

    Example: klab figure samples runs/dynamic --out runs/samples
    """
    from koopman_lab.data.decode import SessionLog
    from koopman_lab.data.recording import recording
    from koopman_lab.figures.samples import draw_samples
    from koopman_lab.figures.samples import samples as collected

    wanted = options.parse_windows(windows)
    log = SessionLog(session, salvage=salvage)
    recorded = recording(log)
    shown = collected(recorded, wanted)
    try:
        draw_samples(file, shown, INPUT_UNITS[recorded.config.robot.kind])
    except OSError as error:
        raise DataError(
            f"{file}: cannot be written ({error.strerror}); choose another file with --out"
        ) from None
    show_damage(log.path, log.damage)
    err.print(f"figure: {file.with_suffix('.png')}")

"""`klab figure`: figures of the paper, from what was recorded here."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated

import typer

from koopman_lab.errors import DataError
from koopman_lab.files import writing_where_named
from koopman_lab.robots.table import robot_type
from offboard.commands.data.validation_inputs import models_and_runs
from offboard.terminal import options
from offboard.terminal.choices import Commands
from offboard.terminal.needs import needs
from offboard.terminal.output import err, show_passed_over

app = Commands(help="Draw figures of the paper from what was recorded.", no_args_is_help=True)


FigureFile = Annotated[
    Path,
    typer.Option("--out", metavar="FILE", help="Draw FILE.pdf and FILE.png, write CSV files."),
]


@app.command()
@needs("desk")
def samples(
    session: Annotated[
        Path, typer.Argument(metavar="SESSION_DIR_OR_LOG", help="From `klab calibrate`.")
    ],
    file: FigureFile,
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
    from koopman_lab.figures.samples_figure import draw_samples
    from koopman_lab.figures.samples_figure import shown_inputs as collected

    window_sizes = options.parse_windows(windows)
    log = SessionLog(session, salvage=salvage)
    recorded = recording(log)
    shown = collected(recorded, window_sizes)
    with _drawing(file):
        draw_samples(file, shown, robot_type(recorded.config.robot.kind))
    show_passed_over(log.passed_over)


@app.command()
@needs("desk")
def dictionaries(
    paths: options.ModelsAndRuns,
    file: FigureFile,
    window: options.Window = None,
    salvage: options.Salvage = False,
) -> None:
    """Draw what models predict for whole reference runs in open loop, and their one-step errors.

    A column for each session; with reprojection, from the nominal start.

    Example: klab figure dictionaries runs/D8Eul.npz runs/infinity runs/square --out runs/openloop
    """
    from koopman_lab.figures.dictionaries_figure import draw_dictionaries

    models, sessions, _ = inputs = models_and_runs(paths, window, salvage=salvage)
    with _drawing(file):
        draw_dictionaries(file, models, sessions)
    inputs.show_passed_over()


@app.command()
@needs("desk")
def multistep(
    paths: options.ModelsAndRuns,
    file: FigureFile,
    steps: options.Steps = 20,
    window: options.Window = None,
    salvage: options.Salvage = False,
) -> None:
    """Draw the errors of 1, 2, ... steps along the reference runs of one session.

    Averaged over the runs and the largest of them, of one model with reprojection and without,
    and of the nominal equations.

    Example: klab figure multistep runs/D8Eul.npz runs/infinity --out runs/multistep
    """
    from koopman_lab.figures.multistep_figure import draw_multi_step, multi_step

    models, sessions, _ = inputs = models_and_runs(paths, window, salvage=salvage)
    if len(models) > 1 or len(sessions) > 1:
        raise DataError(
            f"{len(models)} models and {len(sessions)} sessions: this figure is of one model on "
            "one session; `klab validate` compares several"
        )
    (name, model), runs = next(iter(models.items())), sessions[0]
    errors = multi_step(name, model, runs, steps)
    with _drawing(file):
        draw_multi_step(file, errors, f"{runs.count} runs, {runs.shape}")
    inputs.show_passed_over()


@contextlib.contextmanager
def _drawing(file: Path) -> Iterator[None]:
    """Say where the figure is, or that it cannot be written there."""
    with writing_where_named(file):
        yield
    err.print(f"figure: {file.with_suffix('.png')}")

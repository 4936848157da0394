"""The ``klab`` command."""

from __future__ import annotations

import sys

import typer

from koopman_lab.errors import LabError
from offboard.console import bench, dataset, figure, log, model, run, study
from offboard.console.calibrate import calibrate
from offboard.console.compare import compare
from offboard.console.demo import demo
from offboard.console.doctor import doctor
from offboard.console.estop import estop
from offboard.console.fault import fault
from offboard.console.goal import goal
from offboard.console.park import park
from offboard.console.reference import reference
from offboard.console.replay import replay
from offboard.console.reproduce import reproduce
from offboard.console.rerun import rerun
from offboard.console.simulate import simulate
from offboard.console.status import down, status
from offboard.console.terminal import err
from offboard.console.topics import topics
from offboard.console.train import train
from offboard.console.up import up
from offboard.console.validate import validate
from offboard.console.view import view

EXPECTED_MISTAKE = 2
INTERRUPTED = 130

app = typer.Typer(
    help="Calibrate a differential-drive robot, learn its Koopman model, park it.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"]},
)
COMMANDS = (
    *(demo, up, status, down, view, topics, calibrate, train, park, compare, simulate, reference),
    *(validate, reproduce, replay, rerun, goal, estop, fault, doctor),
)
for command in COMMANDS:
    app.command()(command)
app.add_typer(run.app, name="run")
app.add_typer(log.app, name="log")
app.add_typer(dataset.app, name="dataset")
app.add_typer(model.app, name="model")
app.add_typer(figure.app, name="figure")
app.add_typer(bench.app, name="bench")
app.add_typer(study.app, name="study")


def main() -> None:
    """Run the command; an expected mistake is one message and exit code 2."""
    try:
        app()
    except LabError as error:
        err.print(f"klab: {error}", markup=False)
        sys.exit(EXPECTED_MISTAKE)
    except KeyboardInterrupt:
        sys.exit(INTERRUPTED)


if __name__ == "__main__":
    main()

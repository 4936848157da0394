"""The ``klab`` command."""

from __future__ import annotations

import sys

from koopman_lab.errors import LabError
from offboard.bench import commands as bench
from offboard.cli import run
from offboard.commands import log
from offboard.commands.calibrate import calibrate
from offboard.commands.compare import compare
from offboard.commands.data import dataset_commands, figure
from offboard.commands.data import model_info as model
from offboard.commands.data.train_model import train
from offboard.commands.data.validate import validate
from offboard.commands.demo import demo
from offboard.commands.doctor import doctor
from offboard.commands.down import down
from offboard.commands.drive_reference import reference
from offboard.commands.estop import estop
from offboard.commands.fault import fault
from offboard.commands.goal import goal
from offboard.commands.park import park
from offboard.commands.replay_log import replay
from offboard.commands.rerun_node import rerun
from offboard.commands.simulate import simulate
from offboard.commands.status import status
from offboard.commands.studies import study
from offboard.commands.topics import topics
from offboard.commands.up import up
from offboard.commands.view import view
from offboard.reproduction.reproduce import reproduce
from offboard.terminal.choices import Commands
from offboard.terminal.output import err

EXPECTED_MISTAKE = 2
INTERRUPTED = 130

app = Commands(
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
app.add_typer(dataset_commands.app, name="dataset")
app.add_typer(model.app, name="model")
app.add_typer(figure.app, name="figure")
app.add_typer(bench.app, name="bench")
app.add_typer(study.app, name="study")


def main() -> None:
    """Run the command; an expected mistake is one message and exit code 2."""
    try:
        app()
    except LabError as error:
        err.print(f"klab: {error}")
        sys.exit(EXPECTED_MISTAKE)
    except KeyboardInterrupt:
        sys.exit(INTERRUPTED)


if __name__ == "__main__":
    main()

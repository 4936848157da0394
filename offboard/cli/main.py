"""The ``klab`` command.

Each command stands in the table by where it is. One that is named is imported alone, since all of
them together take longer to load than most of them to run.
"""

from __future__ import annotations

import errno
import sys
from collections.abc import Iterable
from functools import cache
from pkgutil import resolve_name
from typing import Any

import typer

from koopman_lab.errors import LabError
from offboard.terminal.choices import Commands
from offboard.terminal.output import err, show_crash

EXPECTED_MISTAKE = 2
INTERRUPTED = 130
NO_ROOM = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EROFS)
"""What a disk that is full, or may not be written, answers."""

COMMANDS = {
    "demo": "offboard.commands.demo:demo",
    "up": "offboard.commands.up:up",
    "status": "offboard.commands.status:status",
    "down": "offboard.commands.down:down",
    "view": "offboard.commands.view:view",
    "topics": "offboard.commands.topics:topics",
    "calibrate": "offboard.commands.calibrate:calibrate",
    "train": "offboard.commands.data.train_model:train",
    "park": "offboard.commands.park:park",
    "compare": "offboard.commands.compare:compare",
    "simulate": "offboard.commands.simulate:simulate",
    "reference": "offboard.commands.drive_reference:reference",
    "validate": "offboard.commands.data.validate:validate",
    "reproduce": "offboard.reproduction.reproduce:reproduce",
    "replay": "offboard.commands.replay_log:replay",
    "rerun": "offboard.commands.rerun_node:rerun",
    "goal": "offboard.commands.goal:goal",
    "estop": "offboard.commands.estop:estop",
    "fault": "offboard.commands.fault:fault",
    "doctor": "offboard.commands.doctor:doctor",
    "guide": "offboard.commands.guide:guide",
    "config": "offboard.commands.config:app",
    "key": "offboard.commands.key:app",
    "relay": "offboard.commands.relay:relay",
    "run": "offboard.cli.run:app",
    "log": "offboard.commands.log:app",
    "dataset": "offboard.commands.data.dataset_commands:app",
    "model": "offboard.commands.data.model_info:app",
    "figure": "offboard.commands.data.figure:app",
    "bench": "offboard.bench.commands:app",
    "study": "offboard.commands.studies.study:app",
}
"""Functions and groups, in the order of the help."""
ABOUT_ALL = ("doctor",)
"""Commands that say something of all commands."""


def app_of(names: Iterable[str]) -> Commands:
    """Return the command line with some of the commands."""
    commands = Commands(
        help="Calibrate a differential-drive robot, learn its Koopman model, park it.",
        no_args_is_help=True,
        pretty_exceptions_enable=False,
        rich_markup_mode=None,
        context_settings={"help_option_names": ["-h", "--help"]},
    )
    # Without it a single command would be no subcommand.
    commands.callback()(_group)
    for name in names:
        command = resolve_name(COMMANDS[name])
        if isinstance(command, typer.Typer):
            commands.add_typer(command, name=name)
        else:
            commands.command(name)(command)
    return commands


@cache
def whole_app() -> Commands:
    """Return the command line with all commands."""
    return app_of(COMMANDS)


def __getattr__(name: str) -> Any:
    if name == "app":
        return whole_app()
    raise AttributeError(name)


def main() -> None:
    """Run the command; an expected mistake is one message and exit code 2."""
    named = sys.argv[1] if len(sys.argv) > 1 else ""
    alone = named in COMMANDS and named not in ABOUT_ALL
    sys.excepthook = show_crash
    try:
        (app_of([named]) if alone else whole_app())()
    except LabError as error:
        err.print(f"klab: {error}")
        sys.exit(EXPECTED_MISTAKE)
    except OSError as error:
        if error.errno not in NO_ROOM:
            raise
        file = "what is said or written here" if error.filename is None else error.filename
        err.print(
            f"klab: {file}: cannot be written ({error.strerror}); make room on the disk, or choose "
            "another place with --out"
        )
        sys.exit(EXPECTED_MISTAKE)
    except KeyboardInterrupt:
        sys.exit(INTERRUPTED)


def _group() -> None:
    pass


if __name__ == "__main__":
    main()

"""`klab key`: the lab's key, without which nobody may drive a robot."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from offboard.terminal.choices import Commands
from offboard.terminal.output import err

app = Commands(help="The lab's key: who has it may drive.", no_args_is_help=True)


@app.callback()
def _group() -> None:
    """Keep the subcommand a subcommand."""


@app.command()
def new(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="The file to make.")] = Path(
        "lab.key"
    ),
) -> None:
    """Make a key that only you can read; a file that is there is never overwritten.

    Every machine of the lab gets a copy, and `bus.key_file` in its configuration names it.

    Example: klab key new lab.key
    """
    from koopman_lab.bus.lab_key import fingerprint, write_new_key

    key = write_new_key(file)
    err.print(
        f"{file}: key {fingerprint(key)}; copy it to every machine of the lab (scp -p), and name "
        f"it on each in the configuration: --set bus.key_file={file.absolute()}"
    )

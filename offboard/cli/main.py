"""The ``klab`` command."""

from __future__ import annotations

import contextlib
import errno
import os
import sys
from functools import cache
from typing import Annotated, Any

import typer

from koopman_lab.errors import LabError
from offboard.cli.command_group import KlabGroup
from offboard.terminal.choices import Commands
from offboard.terminal.exit_codes import ExitCode, code_of

NAME = "klab"
NO_ROOM = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EROFS)
"""What a disk that is full, or may not be written, answers."""


def _show_version(asked: bool) -> None:
    if asked:
        from importlib.metadata import version

        typer.echo(f"{NAME} {version('koopman-lab')}")
        raise typer.Exit(ExitCode.DONE)


def _group(
    version: Annotated[
        bool,
        typer.Option(
            "--version", callback=_show_version, is_eager=True, help="Say which version this is."
        ),
    ] = False,
) -> None:
    """Calibrate a differential-drive robot, learn its Koopman model, park it."""


@cache
def whole_app() -> Commands:
    """Return the whole command line; commands are imported when they are needed."""
    klab = Commands(
        cls=KlabGroup,
        no_args_is_help=True,
        pretty_exceptions_enable=False,
        context_settings={"help_option_names": ["-h", "--help"]},
    )
    klab.callback()(_group)
    return klab


def command_line() -> Any:
    """Return the command line as it is called."""
    return typer.main.get_command(whole_app())


def main() -> None:
    """Run what was typed, and end with the exit code that says how it went.

    An expected mistake is one message; so is a standard output that takes no more, as one on a full
    disk.
    """
    code = _run()
    for stream in (sys.stdout, sys.stderr):
        code = _flushed(stream, code)
    sys.exit(code)


def _run() -> Any:
    try:
        command_line()(prog_name=NAME)
    except SystemExit as end:
        return end.code
    except KeyboardInterrupt:
        return _end(ExitCode.INTERRUPTED, "interrupted")
    except LabError as error:
        return _end(code_of(error), str(error))
    except OSError as error:
        if error.errno in NO_ROOM:
            return _no_room(error)
        return _crash()
    except Exception:  # whatever it is, the code says that it is ours
        return _crash()
    return ExitCode.DONE


def _end(code: ExitCode, text: str) -> ExitCode:
    from offboard.terminal.output import err

    with contextlib.suppress(OSError):
        err.print(f"{NAME}: {text}")
    return code


def _no_room(error: OSError) -> ExitCode:
    file, remedy = "what is said or written here", "choose another place with --out"
    if error.filename is not None:
        file = error.filename
    return _end(
        ExitCode.LAB_FAILURE,
        f"{file}: cannot be written ({error.strerror}); make room on the disk, or {remedy}",
    )


def _crash() -> ExitCode:
    from offboard.terminal.output import show_crash

    with contextlib.suppress(OSError):
        show_crash(*sys.exc_info())
    return _end(ExitCode.CRASH, "the above is a fault of this program; please report it")


def _flushed(stream: Any, code: Any) -> Any:
    """Write what is left; return the exit code, which is another one where nobody takes it."""
    try:
        stream.flush()
        return code
    except BrokenPipeError:
        code = ExitCode.UNREAD
    except OSError as error:
        code = _no_room(error)
    # The interpreter is not to try it once more at its end.
    with contextlib.suppress(OSError, ValueError):
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, stream.fileno())
        os.close(nowhere)
    return code


def __getattr__(name: str) -> Any:
    if name == "app":
        return whole_app()
    raise AttributeError(name)


if __name__ == "__main__":
    from offboard.cli.start import ended_quietly

    ended_quietly(main)

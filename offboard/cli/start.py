"""Where the ``klab`` command begins: Ctrl-C ends it quietly also while it is still loading."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable

STOP = "estop"
"""The command that does not wait until the others are loaded."""


def main() -> None:
    """Load the command and run it."""
    ended_quietly(_load_and_run)


def open_standard_streams() -> None:
    """Open what whoever started us has closed of input, output and error, onto nothing.

    Otherwise the next file or socket takes that number, and gets what is said.
    """
    for descriptor, (name, mode) in enumerate((("stdin", "r"), ("stdout", "w"), ("stderr", "w"))):
        if not _is_open(descriptor):
            os.open(os.devnull, os.O_RDWR)  # takes the lowest number that is free
        if getattr(sys, name) is None:
            setattr(sys, name, open(descriptor, mode, encoding="utf-8", closefd=False))  # noqa: SIM115


def _is_open(descriptor: int) -> bool:
    try:
        os.fstat(descriptor)
    except OSError:
        return False
    return True


def ended_quietly(run: Callable[[], None]) -> None:
    """Run something; Ctrl-C ends it in a word, and nothing after its end."""
    open_standard_streams()
    try:
        run()
    except KeyboardInterrupt:
        from offboard.terminal.exit_codes import ExitCode

        sys.stderr.write("klab: interrupted\n")
        sys.exit(ExitCode.INTERRUPTED)
    finally:
        import signal

        # All is said and done; what is left is the interpreter's own end.
        signal.signal(signal.SIGINT, signal.SIG_IGN)


def _load_and_run() -> None:
    if sys.argv[1:2] == [STOP]:
        # First of all, as all that follows is loaded the sooner for it.
        from koopman_lab.bus.priority import STOP_PRIORITY, ask_for_priority

        ask_for_priority(STOP_PRIORITY)
        from offboard.cli.stop_at_once import stop_at_once

        code = stop_at_once(sys.argv[2:])
        if code is not None:
            sys.exit(code)
    from offboard.cli.main import main as run

    run()


if __name__ == "__main__":
    main()

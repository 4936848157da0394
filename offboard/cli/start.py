"""Where the ``klab`` command begins: Ctrl-C ends it quietly also while it is still loading."""

from __future__ import annotations

import sys

INTERRUPTED = 130


def main() -> None:
    """Load the command and run it."""
    try:
        from offboard.cli.main import main as run

        run()
    except KeyboardInterrupt:
        sys.exit(INTERRUPTED)

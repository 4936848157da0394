"""The `klab` command for as long as whoever started it lives."""

from __future__ import annotations

import os
import sys
import threading

from offboard.cli.main import main

LEFT_ALONE = 1


def _end_when_closed(lifeline: int) -> None:
    """Wait until the other end of the pipe is gone, which nobody ever writes to."""
    os.read(lifeline, 1)
    os._exit(LEFT_ALONE)


if __name__ == "__main__":
    threading.Thread(target=_end_when_closed, args=(int(sys.argv.pop(1)),), daemon=True).start()
    main()

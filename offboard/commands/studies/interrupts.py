"""Keeps Ctrl-C away from the processes of a study: only who was typed ends in words."""

from __future__ import annotations

import contextlib
import signal
from collections.abc import Iterator


@contextlib.contextmanager
def interrupts_held_back() -> Iterator[None]:
    """Let processes and threads that are started inside the block never see Ctrl-C.

    A terminal sends it to all of them, and each would end with a traceback of its own; whoever
    started them ends them.
    """
    from multiprocessing import resource_tracker

    from joblib.externals.loky.backend import resource_tracker as tracker_of_joblib

    # Each lets Ctrl-C through again when it starts, which must not be inside the block.
    resource_tracker.ensure_running()
    tracker_of_joblib.ensure_running()
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)

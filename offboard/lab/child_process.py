"""How a child process is asked to end, and what its end says."""

from __future__ import annotations

import contextlib
import shutil
import signal
import subprocess
from pathlib import Path

STOP_SIGNALS = (signal.SIGINT, signal.SIGTERM)
PATIENCE_S = 3.0
"""Time that a process has to end after each of these signals, before SIGKILL ends it."""
KILLED = f"killed by SIGKILL, {PATIENCE_S:g} s after SIGTERM and {2 * PATIENCE_S:g} s after SIGINT"
SCARCE_BYTES = 1 << 16
"""With less room than this on its disk, a process may have had none for its last words."""


def exit_text(code: int) -> str:
    """Return in words what the exit code of a child says; a negative one is a signal."""
    return f"signal {signal.Signals(-code).name}" if code < 0 else f"exit code {code}"


def silence_text(file: Path) -> str:
    """Return what to say of a process that left no last words in its file."""
    if shutil.disk_usage(file.parent).free < SCARCE_BYTES:
        return f"not a word: the disk of {file.parent} is full; make room on it"
    return "it said nothing"


def end_child(child: subprocess.Popen[bytes]) -> bool:
    """End a process and wait until it is gone; return whether only SIGKILL did."""
    for number in STOP_SIGNALS:
        if child.poll() is not None:
            return False
        child.send_signal(number)
        with contextlib.suppress(subprocess.TimeoutExpired):
            child.wait(PATIENCE_S)
    child.kill()
    # How long the kernel of a busy machine takes for that is no matter of patience.
    return child.wait() == -signal.SIGKILL

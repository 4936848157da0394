"""A lock file that one process of this machine holds, and that says who does."""

from __future__ import annotations

import contextlib
import fcntl
import os
from collections.abc import Iterator
from pathlib import Path


class LockHeldError(Exception):
    """Another process holds the lock; the message says which, as far as it has said so."""


@contextlib.contextmanager
def held(file: Path) -> Iterator[None]:
    """Hold a lock file in the block; the lock goes with the process, however it ends.

    Raises
    ------
    LockHeldError
        If another process holds it.
    OSError
        If the file cannot be opened.
    """
    file.parent.mkdir(parents=True, exist_ok=True)
    with file.open("a+") as lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            lock.seek(0)
            raise LockHeldError(lock.read().strip() or "another process") from None
        lock.truncate(0)
        lock.write(f"process {os.getpid()}")
        lock.flush()
        yield

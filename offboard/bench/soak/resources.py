"""Memory and open descriptors of processes that live on, so that a leak is seen."""

from __future__ import annotations

import contextlib
from dataclasses import dataclass
from pathlib import Path

from offboard.lab.process_cost import memory_mb


@dataclass
class Resources:
    """What one process held, from when it was warm until it was last seen.

    Attributes
    ----------
    name, pid
        Which process.
    first_mb, last_mb
        Resident memory (MB).
    first_descriptors, last_descriptors
        Open files, sockets and pipes.
    looks
        How often it was looked at.
    """

    name: str
    pid: int
    first_mb: float
    last_mb: float
    first_descriptors: int
    last_descriptors: int
    looks: int = 1


class ResourceWatch:
    """Looks at processes now and then; one that has ended keeps what it had."""

    def __init__(self) -> None:
        self._seen: dict[int, Resources] = {}

    def look(self, name: str, pid: int) -> None:
        """Look at a process, if it is there."""
        # It may end while it is looked at.
        with contextlib.suppress(OSError):
            held_mb = memory_mb(pid)
            if not held_mb:
                return
            descriptors = sum(1 for _ in Path(f"/proc/{pid}/fd").iterdir())
            seen = self._seen.get(pid)
            if seen is None:
                self._seen[pid] = Resources(name, pid, held_mb, held_mb, descriptors, descriptors)
            else:
                seen.last_mb, seen.last_descriptors = held_mb, descriptors
                seen.looks += 1

    def longest(self) -> list[Resources]:
        """Return, for each name, the process that was seen most often."""
        longest: dict[str, Resources] = {}
        for seen in self._seen.values():
            if seen.name not in longest or seen.looks > longest[seen.name].looks:
                longest[seen.name] = seen
        return list(longest.values())

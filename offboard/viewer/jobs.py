"""What the page's server needs of whoever starts things for it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol


class Jobs(Protocol):
    """Starts commands one after the other, and says how they went."""

    @property
    def version(self) -> int:
        """Count what has changed."""

    def as_json(self) -> dict[str, Any]:
        """Return what the page shows: what is offered, queue and history."""

    def start(self, task: str, values: Mapping[str, Any]) -> str:
        """Let a command wait for its turn; return what to say of it.

        Raises
        ------
        LabError
            If it cannot be.
        """

    def remove(self, number: int) -> str:
        """End a job, or take it from the queue; return what to say of it.

        Raises
        ------
        LabError
            If it cannot be.
        """

    def withdraw(self, reason: str) -> None:
        """Take away what waits."""

    def heard(self, robots: Mapping[str, str]) -> None:
        """Take the names of the robots that are alive, with their kind where it is known."""

    def step(self) -> None:
        """Look after the job that runs, and begin the next."""

    async def look(self) -> None:
        """Look what lies in the folder of runs."""

    async def close(self) -> None:
        """End the job that runs."""

"""Which connections the page's server keeps: nobody locks others out by opening many of them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Hashable
from dataclasses import dataclass
from enum import IntEnum
from typing import Generic, TypeVar

C = TypeVar("C", bound=Hashable)

MOST_CONNECTIONS = 256
"""Far below the 1024 files that a process may usually have open."""
MOST_OF_A_CLIENT = 192
"""A browser opens six for a page; several people may sit behind one address."""
PATIENCE_S = 10.0
"""So long a connection may take for a request and its answer, or be idle after the last one."""


class _State(IntEnum):
    """What a connection is at, in the order in which they go."""

    IDLE = 0
    NEW = 1
    ANSWERING = 2


@dataclass
class _Connection:
    client: str
    state: _State = _State.NEW


class Connections(Generic[C]):
    """Keeps account of connections, and says which one goes when there are too many.

    One of whoever has most: first one that has had its answer, then one that has asked for nothing
    yet, of these the oldest. Who asks at once gets an answer, whatever others hold open.
    """

    def __init__(self) -> None:
        self._open: dict[C, _Connection] = {}  # oldest first

    def __len__(self) -> int:
        return len(self._open)

    def add(self, connection: C, client: str) -> C | None:
        """Take in a new connection; return one that goes for it, if there are too many.

        Parameters
        ----------
        connection
            Seen for the first time.
        client
            Whose it is: an address.
        """
        counts = Counter(state.client for state in self._open.values())
        surplus = None
        if counts[client] >= MOST_OF_A_CLIENT:
            surplus = self._first_to_go(client)
        elif len(self._open) >= MOST_CONNECTIONS:
            surplus = self._first_to_go(counts.most_common(1)[0][0])
        if surplus is not None:
            del self._open[surplus]
        self._open[connection] = _Connection(client)
        return surplus

    def asked(self, connection: C) -> None:
        """Say that a whole request came, which is being answered."""
        if connection in self._open:
            self._open[connection].state = _State.ANSWERING

    def answered(self, connection: C) -> None:
        """Say that the answer is out, and nothing is asked for now."""
        if connection in self._open:
            self._open[connection].state = _State.IDLE

    def remove(self, connection: C) -> None:
        """Forget a connection that is gone, or no longer one of these."""
        self._open.pop(connection, None)

    def _first_to_go(self, client: str) -> C:
        of_client = [c for c, connection in self._open.items() if connection.client == client]
        return min(of_client, key=lambda c: self._open[c].state)  # the first of equals

"""Lines about what was refused: few of them, however often somebody tries."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

PERIOD_S = 1.0
"""At most one line each, by client and kind."""
MOST_HELD = 256
"""Clients and kinds at a time; what is beyond counts as one client."""
OTHERS = "others"


@dataclass
class _Held:
    until_s: float
    count: int = 0
    newest: str = ""


class Refusals:
    """Says the first refusal at once, and how many followed once a second.

    Parameters
    ----------
    log
        Takes a line.
    """

    def __init__(self, log: Callable[[str], None]) -> None:
        self._log = log
        self._held: dict[tuple[str, str], _Held] = {}

    def note(self, client: str, kind: str, why: str, now_s: float) -> None:
        """Take a refusal.

        Parameters
        ----------
        client
            Its address.
        kind
            What it tried, one of a few words.
        why
            What to say of it.
        now_s
            Time (s) of a clock that does not step.
        """
        if (client, kind) not in self._held and len(self._held) >= MOST_HELD:
            client = OTHERS
        held = self._held.get((client, kind))
        if held is None:
            self._held[client, kind] = _Held(now_s + PERIOD_S)
            self._log(f"refused {client}: {why}")
        else:
            held.count, held.newest = held.count + 1, why

    def work(self, now_s: float) -> None:
        """Say what is due at ``now_s``."""
        for (client, kind), held in list(self._held.items()):
            if now_s < held.until_s:
                continue
            del self._held[client, kind]
            if held.count:
                self._held[client, kind] = _Held(now_s + PERIOD_S)
                self._log(f"refused {client}: {held.newest} (the newest of {held.count})")

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
class _Burst:
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
        self._bursts: dict[tuple[str, str], _Burst] = {}

    def note(self, client: str, kind: str, reason: str, now_s: float) -> None:
        """Take a refusal.

        Parameters
        ----------
        client
            Its address.
        kind
            What it tried, one of a few words.
        reason
            What to say of it.
        now_s
            Time (s) of a clock that does not step.
        """
        if (client, kind) not in self._bursts and len(self._bursts) >= MOST_HELD:
            client = OTHERS
        burst = self._bursts.get((client, kind))
        if burst is None:
            self._bursts[client, kind] = _Burst(now_s + PERIOD_S)
            self._log(f"refused {client}: {reason}")
        else:
            burst.count, burst.newest = burst.count + 1, reason

    def work(self, now_s: float) -> None:
        """Say what is due at ``now_s``."""
        for (client, kind), burst in list(self._bursts.items()):
            if now_s < burst.until_s:
                continue
            del self._bursts[client, kind]
            if burst.count:
                self._bursts[client, kind] = _Burst(now_s + PERIOD_S)
                self._log(f"refused {client}: {burst.newest} (the newest of {burst.count})")

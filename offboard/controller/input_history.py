"""The inputs that were commanded, and when each acts on the robot."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from koopman_lab.units import US_PER_S

MEMORY_S = 5.0
"""No prediction reaches farther back."""


class InputHistory:
    """Commanded inputs, each acting from its time until that of the next one.

    Before the first one nothing acts.

    Parameters
    ----------
    input_dim
        Number m of inputs.
    """

    def __init__(self, input_dim: int) -> None:
        self._none = np.zeros(input_dim)
        self._times: deque[int] = deque()
        self._inputs: deque[NDArray[np.float64]] = deque()

    def add(self, from_us: int, u: NDArray[np.float64]) -> None:
        """Note that ``u`` (m,) acts from a time on (us), no earlier than those before."""
        while self._times and self._times[-1] >= from_us:
            self._times.pop()
            self._inputs.pop()
        self._times.append(from_us)
        self._inputs.append(u)
        oldest_us = from_us - MEMORY_S * US_PER_S
        while len(self._times) > 1 and self._times[1] <= oldest_us:
            self._times.popleft()
            self._inputs.popleft()

    def between(
        self, start_us: int, end_us: int, longest_s: float
    ) -> Iterator[tuple[float, NDArray[np.float64]]]:
        """Yield durations (s), none over ``longest_s``, and the inputs that act in them.

        Of a longer time than :data:`MEMORY_S` only the end: whatever the stamps say, there are so
        many of them at most.
        """
        start_us = max(start_us, end_us - round(MEMORY_S * US_PER_S))
        longest_us = round(longest_s * US_PER_S)
        times, inputs = [start_us, *self._times], [self._none, *self._inputs]
        for k, u in enumerate(inputs):
            begin_us = max(start_us, times[k])
            stop_us = min(end_us, times[k + 1]) if k + 1 < len(times) else end_us
            while begin_us < stop_us:
                duration_us = min(stop_us - begin_us, longest_us)
                yield duration_us / US_PER_S, u
                begin_us += duration_us

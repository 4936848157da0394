"""Messages as stretches of one block of bytes, so that none is copied before it is decoded."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Indices = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Messages:
    """Encoded messages: number k is ``block[starts[k]:stops[k]]``.

    Attributes
    ----------
    block
        Holds them all, and whatever lies between.
    starts, stops
        Byte offsets (N,).
    arrival_us
        Times of arrival (N,) in us.
    """

    block: bytes
    starts: Indices
    stops: Indices
    arrival_us: Indices

    @classmethod
    def joined(cls, messages: Iterable[bytes]) -> Messages:
        """Return messages that come from no log; they arrived at time 0."""
        encoded = list(messages)
        sizes = np.array([len(data) for data in encoded], np.int64)
        stops = np.cumsum(sizes)
        return cls(b"".join(encoded), stops - sizes, stops, np.zeros(len(encoded), np.int64))

    @property
    def sizes(self) -> Indices:
        """Return the number of bytes of each (N,)."""
        return self.stops - self.starts

    def __len__(self) -> int:
        return len(self.starts)

    def __iter__(self) -> Iterator[bytes]:
        for start, stop in zip(self.starts.tolist(), self.stops.tolist(), strict=True):
            yield self.block[start:stop]

    def heads(self, chosen: NDArray[np.bool_], layout: np.dtype[np.void]) -> NDArray[np.void]:
        """Return how the chosen messages (N,) begin, read with a layout no longer than they are."""
        return bytes_at(self.block, self.starts[chosen], layout.itemsize).view(layout)


def bytes_at(block: bytes, offsets: Indices, size: int, kind: str = "V") -> NDArray[Any]:
    """Return the ``size`` > 0 bytes at each offset (N,) as elements of kind ``V`` or ``S``."""
    item = np.dtype(f"{kind}{size}")
    if not len(offsets):
        return np.empty(0, item)
    # Elements that overlap, one beginning at every byte: choosing among them is one fast copy.
    everywhere: NDArray[Any] = np.ndarray((len(block) - size + 1,), item, block, strides=(1,))
    return everywhere[offsets]

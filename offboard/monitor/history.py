"""The newest items of something that goes on, numbered so that a page fetches only what is new."""

from __future__ import annotations

from collections import deque
from itertools import islice
from typing import Any, Generic, NamedTuple, TypeVar

T = TypeVar("T")


class Since(NamedTuple):
    """What a page does not have yet.

    Attributes
    ----------
    first
        Number of the oldest item that is kept; what is older is to be forgotten.
    begin
        Number of the first of ``items``.
    items
        In order, of the history's type; Python 3.10 has no named tuple that could say so.
    """

    first: int
    begin: int
    items: list[Any]


class History(Generic[T]):
    """A bounded list whose items keep their numbers, from 0, when older ones are forgotten."""

    def __init__(self, most: int) -> None:
        self._items: deque[T] = deque(maxlen=most)
        self.next = 0
        """Number of the item that comes next."""

    def append(self, item: T) -> None:
        """Add an item; beyond the limit the oldest is forgotten."""
        self._items.append(item)
        self.next += 1

    def clear(self) -> None:
        """Forget all items, not how many there were."""
        self._items.clear()

    def since(self, number: int) -> Since:
        """Return the items from this number on."""
        first = self.next - len(self._items)
        begin = min(max(number, first), self.next)
        return Since(first, begin, list(islice(self._items, begin - first, None)))

"""What a process keeps at hand, bounded: it lives for weeks, and meets many arms, grids and applications."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Hashable
from threading import Lock
from typing import Generic, TypeVar

T = TypeVar("T")


class Kept(Generic[T]):
    """Values that are dear to make: of those asked for last, as many as weigh `most` together; for many threads.

    The one asked for last is kept whatever it weighs.
    """

    def __init__(self, most: int, weight: Callable[[T], int] = lambda _: 1) -> None:
        self._most, self._weight = most, weight
        self._values: OrderedDict[Hashable, T] = OrderedDict()
        self._held, self._lock = 0, Lock()

    def __len__(self) -> int:
        """How many there are now."""
        return len(self._values)

    def get(self, key: Hashable, make: Callable[[], T]) -> T:
        """The value of a key, made now unless it is kept; where two threads make it, one's is kept."""
        with self._lock:
            if key in self._values:
                self._values.move_to_end(key)
                return self._values[key]
        made = make()  # which may take long, and ask for others
        with self._lock:
            if key not in self._values:
                self._values[key] = made
                self._held += self._weight(made)
            while self._held > self._most and len(self._values) > 1:
                self._held -= self._weight(self._values.popitem(last=False)[1])
            return self._values[key]

"""A cache of arrays for one revision of a graph, bounded in bytes."""

from collections import OrderedDict
from collections.abc import Callable, Hashable
from typing import Any, TypeVar

import numpy as np

Arrays = TypeVar("Arrays", bound=tuple["np.ndarray[Any, Any] | memoryview", ...])


class Cache:
    """Caches tuples of arrays by key; the least recently used one is dropped first.

    Args:
        most_bytes: what all of them may take together; a larger one is computed each time.

    Attributes:
        revision: of the graph that they are of.
        entries: key -> arrays, to look up without `get`; not to be changed.
    """

    def __init__(self, most_bytes: int) -> None:
        self._most_bytes = most_bytes
        self.revision: int | None = None
        self.entries: OrderedDict[Hashable, Any] = OrderedDict()
        self.bytes = 0

    def get(self, revision: int, key: Hashable, make: Callable[[], Arrays]) -> Arrays:
        """Return what `make` gives at this revision; entries of another one are discarded."""
        if revision != self.revision:
            self.clear()
            self.revision = revision
        try:
            known: Arrays | None = self.entries.get(key)
        except TypeError:  # a weight that is not hashable: `make` says what is wrong with it
            return make()
        if known is not None:
            self.entries.move_to_end(key)
            return known
        made = make()
        self._add(key, made)
        return made

    def take_over(self, other: "Cache") -> None:
        """Hold the entries of another cache."""
        self.revision, self.entries, self.bytes = other.revision, other.entries.copy(), other.bytes

    def clear(self) -> None:
        """Discard all entries."""
        self.entries.clear()
        self.bytes = 0

    def _add(self, key: Hashable, made: "tuple[np.ndarray[Any, Any] | memoryview, ...]") -> None:
        size = _bytes(made)
        if size > self._most_bytes:
            return
        while self.bytes + size > self._most_bytes:
            _, oldest = self.entries.popitem(last=False)
            self.bytes -= _bytes(oldest)
        self.entries[key] = made
        self.bytes += size


def _bytes(arrays: "tuple[np.ndarray[Any, Any] | memoryview, ...]") -> int:
    return sum(array.nbytes for array in arrays)

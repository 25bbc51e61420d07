"""Results that hold for one revision of a graph, in a bounded number of bytes."""

from collections import OrderedDict
from collections.abc import Callable, Hashable
from typing import Any, TypeVar

import numpy as np

Arrays = TypeVar("Arrays", bound=tuple["np.ndarray[Any, Any]", ...])


class Cache:
    """Keeps tuples of arrays by key; the one that nobody asked for longest goes first.

    Args:
        most_bytes: what all of them may take together; a larger one is worked out anew each time.
    """

    def __init__(self, most_bytes: int) -> None:
        self._most_bytes = most_bytes
        self._revision: int | None = None
        self._kept: OrderedDict[Hashable, Any] = OrderedDict()
        self.bytes = 0

    def get(self, revision: int, key: Hashable, make: Callable[[], Arrays]) -> Arrays:
        """What `make` gives at this revision; what is known of another one is forgotten."""
        if revision != self._revision:
            self.clear()
            self._revision = revision
        known: Arrays | None = self._kept.get(key)
        if known is not None:
            self._kept.move_to_end(key)
            return known
        made = make()
        self._keep(key, made)
        return made

    def clear(self) -> None:
        """Forget everything."""
        self._kept.clear()
        self.bytes = 0

    def _keep(self, key: Hashable, made: "tuple[np.ndarray[Any, Any], ...]") -> None:
        size = _bytes(made)
        if size > self._most_bytes:
            return
        while self.bytes + size > self._most_bytes:
            _, oldest = self._kept.popitem(last=False)
            self.bytes -= _bytes(oldest)
        self._kept[key] = made
        self.bytes += size


def _bytes(arrays: "tuple[np.ndarray[Any, Any], ...]") -> int:
    return sum(array.nbytes for array in arrays)

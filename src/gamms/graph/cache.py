"""Results that hold for one revision of a graph, in a bounded number of bytes."""

from collections import OrderedDict
from collections.abc import Callable, Hashable
from typing import Any, TypeVar

import numpy as np

Arrays = TypeVar("Arrays", bound=tuple["np.ndarray[Any, Any] | memoryview", ...])


class Cache:
    """Keeps tuples of arrays by key; the one that `get` was asked for longest ago goes first.

    Args:
        most_bytes: what all of them may take together; a larger one is computed each time.

    Attributes:
        revision: of the graph that they are of.
        kept: key -> arrays, to look up without `get`; not to be changed.
    """

    def __init__(self, most_bytes: int) -> None:
        self._most_bytes = most_bytes
        self.revision: int | None = None
        self.kept: OrderedDict[Hashable, Any] = OrderedDict()
        self.bytes = 0

    def get(self, revision: int, key: Hashable, make: Callable[[], Arrays]) -> Arrays:
        """What `make` gives at this revision; what is known of another one is forgotten."""
        if revision != self.revision:
            self.clear()
            self.revision = revision
        try:
            known: Arrays | None = self.kept.get(key)
        except TypeError:  # a weight that is not hashable: `make` says what is wrong with it
            return make()
        if known is not None:
            self.kept.move_to_end(key)
            return known
        made = make()
        self._keep(key, made)
        return made

    def clear(self) -> None:
        """Forget everything."""
        self.kept.clear()
        self.bytes = 0

    def _keep(self, key: Hashable, made: "tuple[np.ndarray[Any, Any] | memoryview, ...]") -> None:
        size = _bytes(made)
        if size > self._most_bytes:
            return
        while self.bytes + size > self._most_bytes:
            _, oldest = self.kept.popitem(last=False)
            self.bytes -= _bytes(oldest)
        self.kept[key] = made
        self.bytes += size


def _bytes(arrays: "tuple[np.ndarray[Any, Any] | memoryview, ...]") -> int:
    return sum(array.nbytes for array in arrays)

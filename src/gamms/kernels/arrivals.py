"""What arrives at rows along weighted ways: sums for probabilities that move, maxima for bounds of how far."""

from collections.abc import Iterator
from math import inf

import numpy as np

from gamms.ir.graph import FloatArray, IntArray

_COLUMNS = 128  # at a time


class Arrivals:
    """Sums and maxima over what leads to each of some rows, for any number of columns at once.

    Everything is added in the order of the sources, one after the other: so the bits do not depend on how many columns
    there are. (The products of SciPy's sparse matrices take a third of the time, but round as its compiler liked.)

    Args:
        sources: (ways,) rows.
        targets: (ways,) rows.
        weights: (ways,)
        size: how many rows there are.
    """

    def __init__(self, sources: IntArray, targets: IntArray, weights: FloatArray, size: int) -> None:
        ways = np.lexsort((sources, targets))
        counts = np.bincount(targets, minlength=size)
        first = np.cumsum(counts) - counts
        self._order = np.argsort(-counts, kind="stable")  # rows, those with the most ways first
        parts = [ways[first[self._order[: int((counts > k).sum())]] + k] for k in range(int(counts.max(initial=0)))]
        self._parts = [(sources[part], weights[part][:, None]) for part in parts]

    def sums(self, values: FloatArray) -> FloatArray:
        """Return what arrives at each row (rows, columns): the weighted sum of the values at the sources."""
        found = np.zeros_like(values)
        for columns in column_blocks(values):
            block, arrived = values[:, columns], np.zeros_like(values[:, columns])
            for sources, weights in self._parts:
                arrived[: len(sources)] += block[sources] * weights
            found[self._order, columns] = arrived
        return found

    def largest(self, values: FloatArray) -> FloatArray:
        """Return the most of the values at the sources, less the weights (rows, columns); -inf where no way leads."""
        found = np.empty_like(values)
        for columns in column_blocks(values):
            block, arrived = values[:, columns], np.full_like(values[:, columns], -inf)
            for sources, weights in self._parts:
                first = arrived[: len(sources)]
                np.maximum(first, block[sources] - weights, out=first)
            found[self._order, columns] = arrived
        return found


def column_blocks(values: FloatArray) -> Iterator[slice]:
    """Yield so many columns at a time that they stay in the cache of the processor: in a third of the time."""
    for begin in range(0, values.shape[1], _COLUMNS):
        yield slice(begin, begin + _COLUMNS)

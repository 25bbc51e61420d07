"""Number things that are alike: first-seen numbers and connected components, as arrays."""

import numpy as np

from gamms.ir.graph import IntArray


def first_seen(keys: IntArray) -> tuple[IntArray, IntArray]:
    """Number the distinct keys 0, 1, … in the order in which they first appear.

    Returns:
        `numbers` (keys,), the number of each key; `firsts` (distinct,), where each number first appears.
    """
    _, firsts, inverse = np.unique(keys, return_index=True, return_inverse=True)
    order = np.argsort(firsts)
    rank = np.empty(len(order), np.int64)
    rank[order] = np.arange(len(order))
    return rank[inverse], firsts[order]


def components(a: IntArray, b: IntArray, count: int) -> IntArray:
    """The smallest row that each of `count` rows is connected to by the pairs `(a[i], b[i])`.

    Union by minimum with pointer jumping: the number of rounds grows with the logarithm of the longest chain.
    """
    label = np.arange(count)
    while True:
        left, right = label[a], label[b]
        differ = left != right
        if not differ.any():
            return label
        a, b = a[differ], b[differ]
        low, high = np.minimum(left, right)[differ], np.maximum(left, right)[differ]
        np.minimum.at(label, high, low)
        label = _flattened(label)


def _flattened(label: IntArray) -> IntArray:
    while True:
        further = label[label]
        if np.array_equal(further, label):
            return label
        label = further

"""The draw of each game's map."""

from collections.abc import Sequence

import numpy as np

from gamms import kernels
from gamms.ir.graph import IntArray

_PURPOSE = "map"


def drawn_maps(seeds: Sequence[int], num_maps: int) -> IntArray:
    """Return the number of the map that each seed draws, (seeds,)."""
    if num_maps == 1:
        return np.zeros(len(seeds), np.int64)
    purposes = np.array([kernels.purpose_key(seed, _PURPOSE) for seed in seeds], np.uint64)
    bits = kernels.draw_bits_rows(purposes, kernels.name_keys([_PURPOSE]), 0)
    return kernels.below_many(bits, num_maps)

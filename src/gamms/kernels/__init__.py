"""Pure functions over arrays: no Context, no files, no logging, no hidden random numbers.

The NumPy versions are the specification; faster twins must match them exactly.
Call them as `kernels.name(...)`. May import: numpy, `gamms.ir`.
"""

from gamms.kernels.cells import CellIndex, build_cells, candidate_rows
from gamms.kernels.csr import group_rows, ragged_rows
from gamms.kernels.paths import distances_to
from gamms.kernels.sight import in_cone
from gamms.kernels.streams import stream

__all__ = [
    "CellIndex",
    "build_cells",
    "candidate_rows",
    "distances_to",
    "group_rows",
    "in_cone",
    "ragged_rows",
    "stream",
]

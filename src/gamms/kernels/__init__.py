"""Pure functions over arrays: no Context, no files, no logging, no hidden random numbers.

The NumPy versions are the specification; faster twins must match them exactly.
Call them as `kernels.name(...)`. May import: numpy, `gamms.ir`.
"""

from gamms.kernels.cells import CellIndex, build_cells, candidate_rows
from gamms.kernels.csr import group_rows, ragged_rows
from gamms.kernels.paths import Arcs, first_steps, make_arcs, tight_arcs
from gamms.kernels.scipy import shortest_distances
from gamms.kernels.sight import in_cone
from gamms.kernels.streams import stream
from gamms.kernels.yaw import about_z, yaw

__all__ = [
    "Arcs",
    "CellIndex",
    "about_z",
    "build_cells",
    "candidate_rows",
    "first_steps",
    "group_rows",
    "in_cone",
    "make_arcs",
    "ragged_rows",
    "shortest_distances",
    "stream",
    "tight_arcs",
    "yaw",
]

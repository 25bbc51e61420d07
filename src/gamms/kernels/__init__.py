"""Pure functions over arrays: no Context, no files, no logging, no hidden random numbers.

The NumPy versions are the specification; faster twins must match them exactly.
Call them as `kernels.name(...)`. May import: numpy, `gamms.ir`.
"""

from gamms.kernels.cells import CellIndex, build_cells, candidate_rows, rows_between
from gamms.kernels.csr import chosen_runs, expand_ranges, group_rows, ragged_rows
from gamms.kernels.draws import draws_by_name, lots_by_name
from gamms.kernels.occlusion import blocks, visible
from gamms.kernels.paths import Arcs, first_steps, make_arcs, tight_arcs
from gamms.kernels.rings import closed_rings
from gamms.kernels.rotations import (
    Quaternion,
    about_z,
    in_view,
    multiply_quaternions,
    quaternion_to_direction,
    unit_quaternion,
    yaw,
)
from gamms.kernels.scipy import shortest_distances
from gamms.kernels.sight import in_cone, is_in_cone
from gamms.kernels.streams import stream, stream_key

__all__ = [
    "Arcs",
    "CellIndex",
    "Quaternion",
    "about_z",
    "blocks",
    "build_cells",
    "candidate_rows",
    "chosen_runs",
    "closed_rings",
    "draws_by_name",
    "expand_ranges",
    "first_steps",
    "group_rows",
    "in_cone",
    "in_view",
    "is_in_cone",
    "lots_by_name",
    "make_arcs",
    "multiply_quaternions",
    "quaternion_to_direction",
    "ragged_rows",
    "rows_between",
    "shortest_distances",
    "stream",
    "stream_key",
    "tight_arcs",
    "unit_quaternion",
    "visible",
    "yaw",
]

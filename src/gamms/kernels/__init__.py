"""Pure functions over arrays: no Context, no files, no logging, no hidden random numbers.

Call them as `kernels.name(...)`. May import: numpy, `gamms.core`, `gamms.ir`.
"""

from gamms.core.draws import below, bits_at, first_key, fraction, turn_key
from gamms.core.routes import widened
from gamms.kernels.cells import (
    CellIndex,
    build_cells,
    candidate_rows,
    candidates_of_each,
    rows_around,
    rows_between,
)
from gamms.kernels.csr import (
    buffer,
    chosen_runs,
    closed_rings,
    equal_runs,
    expand_ranges,
    first_seen,
    group_rows,
    neighborhoods,
    rows_of,
    ways_to,
)
from gamms.kernels.draws import (
    below_many,
    below_of_words,
    bits_at_rows,
    draw_bits,
    draw_bits_each,
    draw_bits_rows,
    first_key_rows,
    fraction_many,
    name_key,
    name_keys,
    normals,
    places_of_agents,
    poisson,
    purpose_key,
    purpose_keys,
    stream,
    stream_key,
    stream_keys,
    stream_words,
    turn_key_rows,
)
from gamms.kernels.fields_of_view import (
    Quaternion,
    about_z,
    cone,
    in_cone,
    in_view,
    multiply_quaternions,
    quaternion_to_direction,
    squares,
    unit_quaternion,
    yaw,
)
from gamms.kernels.matrix_games import saddle_points, solve_matrix_games
from gamms.kernels.occlusion import MARGIN, blocks, visible, visible_from_each
from gamms.kernels.paths import (
    Arcs,
    ForbiddenPaths,
    ReachableNodes,
    Search,
    SearchResult,
    ShortestPath,
    TurnStates,
    least_matching,
    make_arcs,
    route_tables,
    simple_paths,
    turn_states,
)

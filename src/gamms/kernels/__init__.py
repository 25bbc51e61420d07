"""Pure functions over arrays: no Context, no files, no logging, no hidden random numbers.

Call them as `kernels.name(...)`. May import: numpy, `gamms.core`, `gamms.ir`.
"""

from gamms.core.draws import compute_bits, compute_first_key, compute_turn_key, convert_to_fraction, convert_to_integer
from gamms.core.routes import widen_distance
from gamms.kernels.cells import (
    CellIndex,
    build_cells,
    find_candidate_rows,
    find_candidates_of_each,
    find_rows_around,
    find_rows_between,
)
from gamms.kernels.csr import (
    as_buffer,
    expand_ranges,
    find_closed_rings,
    find_equal_runs,
    find_rows,
    group_by_target,
    group_rows,
    list_neighborhoods,
    number_by_appearance,
    select_runs,
)
from gamms.kernels.draws import (
    compute_bits_rows,
    compute_first_key_rows,
    compute_name_key,
    compute_name_keys,
    compute_purpose_key,
    compute_purpose_keys,
    compute_run_seeds,
    compute_turn_key_rows,
    convert_to_fractions,
    convert_to_integers,
    convert_to_normals,
    convert_to_poisson,
    draw_bits,
    draw_bits_each,
    draw_bits_rows,
    draw_from_many_words,
    draw_places,
    stream,
    stream_key,
    stream_keys,
    stream_words,
)
from gamms.kernels.fields_of_view import (
    Quaternion,
    compute_cone,
    compute_heading,
    compute_squares,
    find_in_cone,
    find_in_view,
    make_rotation,
    multiply_quaternions,
    normalize_quaternion,
    quaternion_to_direction,
)
from gamms.kernels.matrix_games import find_saddle_points, solve_matrix_games
from gamms.kernels.occlusion import MARGIN, find_blocking, find_visible, find_visible_from_each
from gamms.kernels.paths import (
    Arcs,
    ForbiddenPaths,
    ReachableNodes,
    Search,
    SearchResult,
    ShortestPath,
    TurnStates,
    compute_route_tables,
    find_edges_without_turn,
    find_least_matching,
    find_simple_paths,
    make_arcs,
    make_turn_states,
)

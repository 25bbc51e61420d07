"""Distances equal those of networkx and, bit for bit, of SciPy; steps keep the rule for ties."""

import itertools
import math
from heapq import heappop, heappush

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gamms import kernels

NODES = 8
ROW = st.integers(0, NODES - 1)
CUTOFFS = st.sampled_from([math.inf, 0.0, 0.3, 4.0])
WEIGHTS = st.one_of(
    st.integers(0, 4).map(float),
    st.sampled_from([0.1, 0.2, 0.3, 1 / 3, 1e-300, 1e16, 1e308, math.inf]),
    st.floats(0.0, 10.0),
)


def edges_of(weights):
    return st.lists(st.tuples(ROW, ROW, weights), max_size=30)


def arcs_of(edges, *, nodes=NODES):
    starts, ends = (np.array([edge[i] for edge in edges], np.int64) for i in (0, 1))
    return kernels.make_arcs(starts, ends, np.array([edge[2] for edge in edges], np.float64), nodes)


def distances(arcs, rows, cutoff=math.inf):
    """Return how far every node is from the nearest of some rows."""
    found = np.full(len(arcs.offsets) - 1, math.inf)
    near = kernels.Search(arcs, np.arange(len(found))).find(rows, within=cutoff)
    found[near.rows] = near.far
    return found


def heap_distances(arcs, rows, cutoff=math.inf):
    """Dijkstra's algorithm with a heap, as textbooks have it."""
    offsets, ends, weights = (column.tolist() for column in arcs)
    distances = [math.inf] * (len(offsets) - 1)
    heap = [(0.0, row) for row in rows.tolist()]
    for _, row in heap:
        distances[row] = 0.0
    while heap:
        distance, node = heappop(heap)
        for arc in range(offsets[node], offsets[node + 1]):
            far = distance + weights[arc]
            if far < distances[ends[arc]] and far <= cutoff:
                distances[ends[arc]] = far
                heappush(heap, (far, ends[arc]))
    return np.array(distances)


@given(edges=edges_of(WEIGHTS), rows=st.lists(ROW, min_size=1, max_size=3), cutoff=CUTOFFS)
def test_distances_are_those_of_the_textbook_bit_for_bit(edges, rows, cutoff):
    arcs, rows = arcs_of(edges), np.array(rows)
    assert distances(arcs, rows, cutoff).tobytes() == heap_distances(arcs, rows, cutoff).tobytes()


@pytest.mark.parametrize("seed", range(3))
def test_distances_on_large_graphs_are_those_of_scipy_bit_for_bit(seed):
    csgraph = pytest.importorskip("scipy.sparse.csgraph")
    from scipy.sparse import csr_array

    rng = np.random.default_rng(seed)
    weights = rng.choice([0.1, 0.2, 0.7, 1.1], 4000) * rng.choice([1.0, 1e-9, 1e9], 4000)
    arcs = kernels.make_arcs(*rng.integers(0, 1000, (2, 4000)), weights, 1000)
    rows = rng.integers(0, 1000, 2)
    matrix = csr_array((arcs.weights, arcs.ends, arcs.offsets), (1000, 1000))
    known = csgraph.dijkstra(matrix, indices=np.unique(rows), min_only=True)
    assert distances(arcs, rows).tobytes() == known.tobytes()


@given(
    edges=edges_of(WEIGHTS),
    roots=st.lists(ROW, min_size=1, max_size=3),
    goals=st.lists(ROW, max_size=4),
    is_nearest=st.booleans(),
    most=st.integers(0, NODES),
)
def test_a_search_for_goals_agrees_with_all_distances(edges, roots, goals, is_nearest, most):
    arcs, roots, goals = arcs_of(edges), np.array(roots), np.array(goals, np.int64)
    search = kernels.Search(arcs, np.arange(NODES))
    known = distances(arcs, roots)[goals]
    for _ in range(2):  # what a search leaves behind does not change the next one
        few, visited = search.compute_distances(roots, goals, most=most)
        assert visited <= most
        assert visited < 0 or few.tolist() == known.tolist()
        found, _ = search.compute_distances(roots, goals, is_nearest=is_nearest)
        wanted = known == known.min(initial=math.inf) if is_nearest else np.ones(len(goals), np.bool_)
        assert found[wanted].tolist() == known[wanted].tolist()
        assert (found >= known).all()


def test_nothing_is_reached_from_nowhere():
    arcs = arcs_of([(0, 1, 1.0)], nodes=3)
    assert distances(arcs, np.zeros(0, np.int64)).tolist() == [math.inf] * 3
    empty = kernels.make_arcs(*np.zeros((2, 0), np.int64), np.zeros(0), 0)
    assert distances(empty, np.zeros(0, np.int64)).tolist() == []


def test_of_parallel_edges_the_cheapest_stays_and_a_closed_one_goes():
    arcs = arcs_of([(0, 1, 5.0), (0, 1, 2.0), (1, 2, math.inf), (0, 0, 0.0)], nodes=3)
    assert [column.tolist() for column in arcs] == [[0, 2, 2, 2], [0, 1], [0.0, 2.0]]


def best_path(edges, source, target, ids):
    """By trying every simple path: the rest from every node on it is shortest; then fewest edges, then least ids."""
    cheapest = {}
    for u, v, weight in edges:
        cheapest[u, v] = min(weight, cheapest.get((u, v), math.inf))

    def ways(path):
        """Every simple path that ends like this one."""
        yield path
        for (u, v), weight in cheapest.items():
            if v == path[0] and u not in path and weight < math.inf:
                yield from ways([u, *path])

    def length(path):
        total = 0.0
        for u, v in zip(path[-2::-1], path[:0:-1], strict=True):
            total += cheapest[u, v]
        return total

    known = [(path, length(path)) for path in ways([target])]
    least = {node: min(far for path, far in known if path[0] == node) for node in {path[0] for path, _ in known}}
    best = {tuple(path) for path, far in known if far == least[path[0]]}
    whole = [path for path, _ in known if path[0] == source and all(tuple(path[i:]) in best for i in range(len(path)))]
    return min(whole, key=lambda path: (len(path), [ids[row] for row in path]), default=None)


@given(
    edges=st.lists(st.tuples(st.integers(0, 5), st.integers(0, 5), WEIGHTS.filter(lambda w: w < 1e300)), max_size=16),
    ids=st.permutations([-5, 0, 7, 11, 2**40, 2**62]),
    target=st.integers(0, 5),
)
def test_steps_lead_along_the_best_path(edges, ids, target):
    arcs, goal = arcs_of([(v, u, weight) for u, v, weight in edges], nodes=6), np.array([target])
    far, steps = (table[0].tolist() for table in kernels.compute_route_tables(arcs, goal, np.array(ids)))
    search = kernels.Search(arcs, np.array(ids))
    for source in range(6):
        path = [source]
        while steps[path[-1]] >= 0:
            path.append(steps[path[-1]])
        best = best_path(edges, source, target, ids)
        assert (path if path[-1] == target else None) == best
        path = search.find_path(source, target, 6, math.inf)
        assert path.rows == (best or [])
        assert path.far == [far[row] for row in path.rows]


def test_rounding_makes_no_detour_out_of_a_rest_that_could_be_shorter():
    """From 0 both ways are 1e16 long once rounded; from 1 the one with more edges is shorter."""
    arcs = arcs_of([(1, 0, 1e16), (3, 1, 0.2), (2, 1, 0.05), (3, 2, 0.05)], nodes=4)
    _, steps = kernels.compute_route_tables(arcs, np.array([3]), np.arange(4))
    assert steps[0].tolist() == [1, 2, 3, -1]


COSTS = st.integers(1, 5).flatmap(
    lambda rows: st.integers(rows, 6).flatmap(
        lambda columns: st.lists(
            st.lists(st.integers(0, 9).map(float) | st.just(math.inf), min_size=columns, max_size=columns),
            min_size=rows,
            max_size=rows,
        )
    )
)


def bounded(costs):
    """Infinite costs as ones that no sum of the others reaches."""
    return [[min(cost, 1000.0) for cost in row] for row in costs]


@given(costs=COSTS)
def test_a_matching_costs_as_little_as_the_best_of_all(costs):
    columns = kernels.find_least_matching(np.array(costs))
    assert len(set(columns)) == len(costs)
    table = bounded(costs)
    best = min(
        sum(row[column] for row, column in zip(table, chosen, strict=True))
        for chosen in itertools.permutations(range(len(costs[0])), len(costs))
    )
    assert sum(row[column] for row, column in zip(table, columns, strict=True)) == best

"""What is near a place: every query equals brute force, wherever the nodes are and whatever was asked before."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gamms.errors import BadValue
from gamms.graph import Graph

ALL_AROUND = 2.0 * math.pi


def uniform(rng, count):
    return rng.uniform(-50, 50, (count, 2))


def clustered(rng, count):
    return rng.choice([-400.0, 0.0, 30.0], (count, 2)) + rng.normal(0, 1, (count, 2))


def with_outliers(rng, count):
    xy = uniform(rng, count)
    xy[:: count // 4] *= 2e7  # to 1e9
    return xy


CLOUDS = {
    "uniform": uniform,
    "clustered": clustered,
    "outliers at 1e9": with_outliers,
    "on a lattice": lambda rng, count: rng.integers(0, 12, (count, 2)) * 1.0,
    "coincident": lambda rng, count: np.full((count, 2), 3.25),
    "coincident but one": lambda rng, count: np.vstack([np.full((count - 1, 2), 7.0), [[8.0, 7.0]]]),
    "on a horizontal line": lambda rng, count: np.column_stack([rng.uniform(0, 99, count), np.zeros(count)]),
    "on a diagonal": lambda rng, count: np.repeat(rng.integers(-40, 40, (count, 1)) * 1.0, 2, axis=1),
    "huge coordinates": lambda rng, count: 1e15 + rng.integers(0, 64, (count, 2)) * 1.0,
    "huge distances": lambda rng, count: rng.uniform(-1e100, 1e100, (count, 2)),
    "tiny distances": lambda rng, count: rng.uniform(-1e-100, 1e-100, (count, 2)),
    "far off the origin": lambda rng, count: rng.uniform(0, 9, (count, 2)) + np.array([385_000.0, 6_672_000.0]),
}


def build(xy, rng, edges):
    graph = Graph()
    ids = rng.permutation(len(xy)) * 3 - 20
    graph.add_nodes(ids, *xy.T)
    ends = rng.choice(ids[: len(ids) // 2], (2, edges))  # half of the nodes are isolated
    graph.add_edges(np.arange(edges), *ends, np.ones(edges))
    return graph


def check(graph, rng, discs=12):
    """Compare with brute force around places in, at the rim of, and far from the cloud."""
    nodes = [graph.get_node(id) for id in graph.get_nodes()]
    edges = [graph.get_edge(id) for id in graph.get_edges()]
    xy = np.array([node[1:] for node in nodes])
    span = max(float(np.ptp(xy)), 1e-300)
    for _ in range(discs):
        x, y = xy[rng.integers(len(xy))] + rng.choice([0.0, 0.0, 0.3, 5.0]) * span
        dx, dy = (xy[rng.integers(len(xy))] - (x, y)).tolist()
        d = rng.choice([0.0, math.sqrt(dx * dx + dy * dy), 0.01 * span, 0.3 * span, 3.0 * span])
        near = {node.id for node in nodes if (node.x - x) ** 2 + (node.y - y) ** 2 <= d**2}
        assert list(graph.get_nodes(d, x, y)) == [node.id for node in nodes if node.id in near]
        at = [edge.id for edge in edges if edge.source in near or edge.target in near]
        assert list(graph.get_edges(d, x, y)) == at
        check_within(graph, nodes, edges, nodes[rng.integers(len(nodes))], d, rng)


def check_within(graph, nodes, edges, here, radius, rng):
    fov = rng.choice([ALL_AROUND, math.pi, 1.0, 0.0])
    angle = rng.uniform(-4, 4)
    heading = (math.cos(angle), math.sin(angle))
    radius = rng.choice([radius, math.inf])

    def is_seen(node):
        dx, dy = node.x - here.x, node.y - here.y
        off = abs(math.remainder(math.atan2(dy, dx) - angle, ALL_AROUND))
        return dx * dx + dy * dy <= radius * radius and (
            fov == ALL_AROUND or off <= fov / 2 + 1e-12 or (dx, dy) == (0.0, 0.0)
        )

    seen = {node.id: node for node in nodes if is_seen(node)}
    found = graph.within(here.id, radius, fov, heading)
    assert list(found.nodes.items()) == list(seen.items())
    assert found.edges == [edge for edge in edges if edge.source in seen and edge.target in seen]


@pytest.mark.parametrize("name", CLOUDS)
@pytest.mark.parametrize("count", [8, 500])
def test_queries_equal_brute_force(name, count):
    rng = np.random.default_rng(count)
    graph = build(CLOUDS[name](rng, count), rng, edges=count)
    check(graph, rng)
    check(graph, rng)  # once more, from the indexes that are there now


@given(
    points=st.lists(st.tuples(*[st.floats(allow_nan=False, allow_infinity=False)] * 2), min_size=1, max_size=8),
    d=st.floats(0.0),
    x=st.floats(allow_nan=False),
    y=st.floats(allow_nan=False),
)
def test_any_finite_coordinates_have_their_euclidean_distance(points, d, x, y):
    graph = Graph()
    graph.add_nodes(range(len(points)), *zip(*points, strict=True))

    def surely(factor):
        with np.errstate(over="ignore"):
            return {i for i, point in enumerate(points) if np.hypot(*np.subtract(point, (x, y))) <= d * factor}

    if math.isfinite(x) and math.isfinite(y):
        found = set(graph.get_nodes(d, x, y))
        assert surely(1 - 1e-15) <= found <= surely(1 + 1e-15) or d == math.inf


@pytest.mark.parametrize("scale", [1e-300, 1e-160, 1.0, 1e160, 1e307])
def test_the_rim_is_inside_at_every_scale(scale):
    graph = Graph()
    graph.add_nodes([1, 2, 3], [0.0, 3 * scale, 4 * scale], [0.0, 4 * scale, 4 * scale])
    assert list(graph.get_nodes(5 * scale, 0.0, 0.0)) == [1, 2]
    assert list(graph.get_nodes(4.999 * scale, 0.0, 0.0)) == [1]
    assert list(graph.get_nodes(0.0, 0.0, 0.0)) == [1]


def test_numpy_numbers_ask_like_plain_ones():
    graph = Graph()
    graph.add_nodes(range(2000), np.arange(2000) * 0.125, np.zeros(2000) + 6_672_000.5)
    for kind in (np.float32, np.float64, np.int64):
        d, x, y = kind(3), kind(100), kind(6_672_000)
        assert list(graph.get_nodes(d, x, y)) == list(graph.get_nodes(float(d), float(x), float(y)))


def test_a_field_of_view_of_half_a_turn_includes_both_sides(graph):
    for id, (x, y) in enumerate([(0, 0), (1, 0), (0, 1), (-1, 0), (0, -1)]):
        graph.add_node({"id": id, "x": x, "y": y})
    assert list(graph.within(0, 1.0, math.pi, (1.0, 0.0)).nodes) == [0, 1, 2, 4]
    assert list(graph.within(0, 1.0, math.pi, (-1.0, 0.0)).nodes) == [0, 2, 3, 4]
    assert list(graph.within(0, 1.0, 0.0, (0.0, 1.0)).nodes) == [0, 2]
    assert list(graph.within(0, 1.0, math.pi, (0.0, 0.0)).nodes) == [0, 1, 2, 3, 4]


def test_a_long_edge_through_the_disc_is_neither_near_nor_within(graph):
    graph.add_nodes([1, 2, 3], [-10.0, 10.0, 0.0], [0.0, 0.0, 0.0])
    graph.add_edge({"id": 1, "source": 1, "target": 2, "length": 20.0})
    assert list(graph.get_edges(1.0, 0.0, 0.0)) == []
    assert list(graph.get_edges(0.0, 10.0, 0.0)) == [1]
    assert graph.within(3, 5.0) == ({3: graph.get_node(3)}, [])
    assert [edge.id for edge in graph.within(3, math.inf).edges] == [1]


def test_a_node_alone_sees_itself(graph):
    graph.add_node({"id": 1, "x": 5.0, "y": 5.0})
    assert list(graph.within(1, 0.0, 0.1, (1.0, 0.0)).nodes) == [1]


def test_sensor_data_is_never_changed_by_a_later_call(graph):
    graph.add_nodes([1, 2], [0.0, 1.0], [0.0, 0.0])
    graph.add_edge({"id": 1, "source": 1, "target": 2, "length": 1.0})
    nodes, edges = graph.within(1, 5.0)
    nodes.clear()
    edges.clear()
    assert [len(part) for part in graph.within(1, 5.0)] == [2, 1]


@pytest.mark.parametrize("radius", [-1.0, math.nan, -math.inf])
def test_a_radius_is_not_negative(graph, radius):
    graph.add_node({"id": 1, "x": 0.0, "y": 0.0})
    with pytest.raises(BadValue, match="radius"):
        graph.within(1, radius)

"""Where agents get by edges: what is kept of the nodes around others is what the graph says of itself."""

from hypothesis import given
from hypothesis import strategies as st

from gamms.game import around
from gamms.game.around import Surroundings
from gamms.game.streets import Streets
from gamms.graph import Graph
from gamms.graph.routes import CachedRoutes

NODES = st.lists(st.integers(0, 99), min_size=1, max_size=9, unique=True)


def graph_of(ids, ends):
    graph = Graph()
    for id in ids:
        graph.add_node({"id": id, "x": 0.0, "y": 0.0})
    for id, (a, b) in enumerate(ends):
        graph.add_edge({"id": id, "source": ids[a % len(ids)], "target": ids[b % len(ids)], "length": 1.0})
    return graph


def found_in(graph, known, node, edges):
    return known.of(graph, Streets(graph._store.columns(), CachedRoutes(graph._store)), node, edges)


@given(
    ids=NODES,
    ends=st.lists(st.tuples(st.integers(0, 8), st.integers(0, 8)), max_size=25),
    gone=st.integers(0, 24),
    edges=st.integers(0, 4),
)
def test_paths_and_distances_are_those_of_the_graph_before_and_after_a_road_is_gone(ids, ends, gone, edges):
    graph, known = graph_of(ids, ends), Surroundings()
    for removed in ([gone] if gone < len(ends) else [], []):
        for node in ids:
            found = found_in(graph, known, node, edges)
            near = graph.distances(source=node, weight=None, cutoff=float(edges))
            assert list(found.hops.items()) == list(near.items())
            assert found.legal == tuple(dict.fromkeys([*graph.neighborhoods[node], *near]))
            for other in near.keys() - {node}:
                assert [node, *found.path(other)] == graph.shortest_path(node, other, None)
        for edge in removed:
            graph.remove_edge(edge)


def test_what_is_kept_is_bounded_and_found_again(monkeypatch):
    monkeypatch.setattr(around, "_MOST_KEPT", 6)
    graph, known = graph_of([0, 1, 2, 3], [(0, 1), (1, 2), (2, 3)]), Surroundings()
    first = [found_in(graph, known, node, 2) for node in range(4)]
    assert len(known._found) < 4
    assert known._kept <= 6
    assert [found_in(graph, known, node, 2) for node in range(4)] == first

"""Where agents get by edges: legal nodes and paths are those of the graph."""

from math import inf

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gamms.errors import BadValue
from gamms.game.movement.legality import MultiEdgeMoves
from gamms.game.movement.streets import StreetGraph
from gamms.graph import Graph
from gamms.graph.routes import CachedRoutes
from gamms.ir.progress import Progress

NODES = st.lists(st.integers(0, 99), min_size=1, max_size=9, unique=True)
ENDS = st.lists(st.tuples(st.integers(0, 8), st.integers(0, 8)), max_size=25)


def graph_of(ids, ends):
    graph = Graph()
    for id in ids:
        graph.add_node({"id": id, "x": 0.0, "y": 0.0})
    for id, (a, b) in enumerate(ends):
        graph.add_edge({"id": id, "source": ids[a % len(ids)], "target": ids[b % len(ids)], "length": 1.0})
    return graph, MultiEdgeMoves(StreetGraph(graph._store.columns(), CachedRoutes(graph._store)))


@given(ids=NODES, ends=ENDS, speed=st.sampled_from([0.0, 0.5, 1.0, 2.0, 3.0, 4.5, inf]))
def test_legal_are_the_neighbors_and_then_the_nodes_within_the_speed(ids, ends, speed):
    graph, walking = graph_of(ids, ends)
    for node in ids:
        near = graph.distances(source=node, weight=None, cutoff=speed)
        assert walking.reachable(node, speed, None) == tuple(dict.fromkeys([*graph.neighborhoods[node], *near]))


@given(ids=NODES, ends=ENDS, speed=st.sampled_from([0.0, 0.5, 1.0, 2.0, 2.5, inf]), agent=st.integers(0, 5))
def test_a_way_is_the_first_part_of_the_shortest_path_of_the_graph(ids, ends, speed, agent):
    graph, walking = graph_of(ids, ends)
    for source in ids:
        for target in set(ids) - {source}:
            if graph.distance(source, target, None) == inf:
                with pytest.raises(BadValue, match=f"from node {source} to node {target}"):
                    walking.towards(agent, source, speed, None, target)
                continue
            path = graph.shortest_path(source, target, None)
            edges = min(int(min(speed, 99)), len(path) - 1)
            left = speed - edges
            begun = Progress(path[edges], path[edges + 1], left) if edges + 1 < len(path) and left > 0.0 else None
            for found in (
                walking.towards(agent, source, speed, None, target),
                walking.along(source, speed, None, path[1:]),
            ):
                assert (found.end, found.path, found.progress) == (path[edges], tuple(path[: edges + 1]), begun)

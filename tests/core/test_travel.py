"""Parallel edges of a map in the core: the cheapest to a node, and the one that leads back."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from gamms.core import travel as core
from gamms.game.movement.travel import make_map
from gamms.graph import Graph

NODES = 6
ROW = st.integers(0, NODES - 1)


def map_on(edges):
    graph = Graph()
    graph.add_nodes(range(NODES), np.zeros(NODES), np.zeros(NODES))
    graph.add_edges(range(len(edges)), *zip(*edges, strict=True))
    columns = graph.columns()
    return make_map(columns, columns.lengths, None, 1.0)


@given(st.lists(st.tuples(ROW, ROW, st.sampled_from([0.0, 3.0, 7.0])), min_size=1, max_size=18))
def test_the_first_of_the_cheapest_edges_is_taken_and_the_first_as_long_leads_back(edges):
    roads = map_on(edges)
    for row, (source, target, length) in enumerate(edges):
        cheapest = min(far for one, other, far in edges if (one, other) == (source, target))
        back = (target, source, length)
        assert core.find_cheapest(roads, source, target) == edges.index((source, target, cheapest))
        assert core.find_reverse_edge(roads, row) == (edges.index(back) if back in edges else -1)


def test_no_edge_leads_where_none_was_built():
    assert core.find_cheapest(map_on([(0, 1, 3.0)]), 1, 0) == -1

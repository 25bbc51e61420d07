"""Places on many edges at once are those on each edge by itself, to the bit."""

import networkx as nx
import numpy as np
from hypothesis import given
from hypothesis import strategies as st

import gamms
from gamms.typing.on_edges import Lines, find_point_along

numbers = st.one_of(st.integers(-3, 3).map(float), st.floats(-1e6, 1e6))
points = st.lists(st.tuples(numbers, numbers), min_size=2, max_size=5)
shares = st.one_of(st.sampled_from([0.0, 0.5, 1.0]), st.floats(0.0, 1.0))


@given(drawn=st.lists(st.tuples(points, st.booleans(), shares), min_size=1, max_size=5))
def test_places_on_edges_are_found_together_as_one_by_one(drawn):
    graph = nx.MultiDiGraph()
    for number, (line, is_straight, *_) in enumerate(drawn):
        for node, (x, y) in ((2 * number, line[0]), (2 * number + 1, line[-1])):
            graph.add_node(node, x=x, y=y)
        graph.add_edge(2 * number, 2 * number + 1, id=number, **({} if is_straight else {"linestring": line}))
    with gamms.create_context(vis_engine=gamms.visual.Engine.NO_VIS) as ctx:
        ctx.graph.attach_networkx_graph(graph)
        columns, edges = ctx.graph.columns(), np.arange(len(drawn))
        flat = [list(ctx.graph.graph.get_edge(id).points) for id in columns.edge_ids.tolist()]
        drawn = [drawn[id] for id in columns.edge_ids.tolist()]
        begin = np.array([one[2] for one in drawn])
        expected = [find_point_along(line, one[2]) for line, one in zip(flat, drawn, strict=True)]
        assert (
            list(zip(*(column.tolist() for column in Lines(columns).find_points(edges, begin)), strict=True))
            == expected
        )

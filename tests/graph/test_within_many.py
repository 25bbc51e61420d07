"""What is around many nodes, worked out together, equals what is around each by itself."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gamms.errors import BadValue, UnknownName
from gamms.graph import Graph
from gamms.typing.graph_engine import IGraph

PLACES = st.tuples(*[st.sampled_from([0.0, 1.0, 2.5, 3.0, -4.0])] * 2)
RADII = st.sampled_from([0.0, 1.0, 2.5, np.hypot(1.0, 2.5), 5.0, 1e-200, 1e200, np.inf])


def check(graph, radius):
    ids = list(graph.get_nodes())
    asked = [*ids[::-1], *ids[:2]]
    many, one_by_one = graph.within_many(asked, radius), IGraph.within_many(graph, asked, radius)
    assert [list(seen.nodes.items()) for seen in many] == [list(seen.nodes.items()) for seen in one_by_one]
    assert [seen.edges for seen in many] == [seen.edges for seen in one_by_one]


@given(data=st.data())
def test_many_nodes_see_what_each_sees_whatever_was_changed_before(data):
    places = data.draw(st.lists(PLACES, min_size=1, max_size=9))
    graph = Graph()
    for id, (x, y) in enumerate(places):
        graph.add_node({"id": 7 - id, "x": x, "y": y})
    for id in range(data.draw(st.integers(0, 12))):  # self-loops and parallel edges among them
        source, target = (7 - data.draw(st.integers(0, len(places) - 1)) for _ in range(2))
        graph.add_edge({"id": id, "source": source, "target": target, "length": 1.0})
    check(graph, data.draw(RADII))
    for step in range(data.draw(st.integers(0, 4))):
        nodes, edges = list(graph.get_nodes()), list(graph.get_edges())
        kind = data.draw(st.sampled_from(["remove node", "move node", "add", "remove edge", "move edge"]))
        if kind == "remove node" and len(nodes) > 1:
            graph.remove_node(data.draw(st.sampled_from(nodes)))
        elif kind == "move node":
            x, y = data.draw(PLACES)
            graph.update_node({"id": data.draw(st.sampled_from(nodes)), "x": x, "y": y})
        elif kind == "add":
            x, y = data.draw(PLACES)
            graph.add_node({"id": 100 + step, "x": x, "y": y})
            end = data.draw(st.sampled_from(nodes))
            graph.add_edge({"id": 100 + step, "source": 100 + step, "target": end, "length": 1.0})
            graph.add_edge({"id": 200 + step, "source": end, "target": 100 + step, "length": 1.0})
        elif kind == "remove edge" and edges:
            graph.remove_edge(data.draw(st.sampled_from(edges)))
        elif edges:
            ends = {end: data.draw(st.sampled_from(nodes)) for end in ("source", "target")}
            graph.update_edge({"id": data.draw(st.sampled_from(edges)), **ends})
        check(graph, data.draw(RADII))


def test_asking_of_no_node_answers_nothing_and_of_a_missing_one_is_refused():
    graph = Graph()
    graph.add_node({"id": 3, "x": 0.0, "y": 0.0})
    assert graph.within_many([], 1.0) == []
    with pytest.raises(UnknownName, match="9"):
        graph.within_many([3, 9], 1.0)
    with pytest.raises(BadValue, match="radius"):
        graph.within_many([3], -1.0)

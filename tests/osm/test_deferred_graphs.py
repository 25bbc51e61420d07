"""A graph of roads is filled when it is first looked at; a context that it is attached to takes its columns."""

import copy
import pickle

import networkx as nx
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import gamms
from gamms.errors import TooLarge
from gamms.limits import allowing
from gamms.osm.network import RoadNetwork
from gamms.osm.networkx_bridge import to_digraph

NODES = 5
ROW = st.integers(0, NODES - 1)
TAGS = st.dictionaries(
    st.sampled_from(["name", "lanes", "highway", "travel_time", "speed_kph", "maxspeed"]),
    st.sampled_from(["a", 2, 7.5, ["x", "y"]]),
)
ROADS = st.lists(st.tuples(ROW, ROW, st.booleans(), st.integers(0, 2), st.booleans()), max_size=10)


def network(roads, tags):
    xy = np.array([(0, 0), (10, 0), (10, 10), (0, 10), (5, 20)], np.float64)
    shapes = [np.stack([xy[u], *([xy[u] + (3, 4)] if is_bent else []), xy[v]]) for u, v, _, _, is_bent in roads]
    columns = np.array([road[:2] for road in roads], np.int64).reshape(-1, 2)
    return RoadNetwork(
        xy=xy,
        sources=columns[:, 0],
        targets=columns[:, 1],
        offsets=np.cumsum([0, *map(len, shapes)]),
        points=np.concatenate([np.zeros((0, 2)), *shapes]),
        lengths=np.array([float(10 + number) for number in range(len(roads))], np.float64),
        two_way=np.array([road[2] for road in roads], np.bool_),
        ways=np.array([road[3] for road in roads], np.int64),
        tags=tags,
        crs="EPSG:32635",
    )


@given(roads=ROADS, tags=st.lists(TAGS, min_size=3, max_size=3))
def test_columns_are_those_of_the_filled_graph(roads, tags):
    packed = []
    for is_filled in (False, True):
        graph = to_digraph(network(roads, copy.deepcopy(tags)), {"resolution": 10.0})
        if is_filled:
            list(graph)
        with gamms.create_context() as ctx:
            ctx.graph.attach_networkx_graph(graph)
            assert (type(graph) is nx.DiGraph) == is_filled
            packed.append(ctx.graph.storage.pack())
            edges = [ctx.graph.graph.get_edge(id) for id in ctx.graph.graph.get_edges()]
            packed.append([(edge, edge.points, list(ctx.graph.graph.get_neighbors(edge.source))) for edge in edges])
    assert packed[:2] == packed[2:]


LOOKS = {
    "list": list,
    "contains": lambda graph: 0 in graph,
    "get": lambda graph: graph[0],
    "nodes": lambda graph: graph.nodes,
    "edge": lambda graph: graph.number_of_edges(0, 1),
    "weight": lambda graph: graph.size("length"),
    "copy": lambda graph: graph.copy(),
    "deepcopy": copy.deepcopy,
    "pickle": pickle.dumps,
    "set": lambda graph: setattr(graph, "title", "town"),
    "name": lambda graph: setattr(graph, "name", "town"),
    "add": lambda graph: graph.add_node(99),
    "path": lambda graph: nx.shortest_path(graph, 0, 1),
}


@pytest.mark.parametrize("look", LOOKS.values(), ids=LOOKS)
def test_any_look_inside_fills_the_graph(look):
    graph = to_digraph(network([(0, 1, True, 0, False), (1, 2, False, 0, True)], [{"name": "a"}]))
    look(graph)
    assert type(graph) is nx.DiGraph
    assert graph.number_of_edges() == 3
    assert graph.edges[1, 2]["length"] == 11.0
    assert type(pickle.loads(pickle.dumps(graph))) is nx.DiGraph


COUNTS = [
    *(len, bool, str, nx.density, nx.is_directed, nx.number_of_nodes, nx.number_of_edges),
    lambda graph: (graph.number_of_nodes(), graph.order(), graph.number_of_edges(), graph.size()),
    lambda graph: (graph.is_directed(), graph.is_multigraph(), graph.name, dict(graph.graph)),
]


@given(roads=ROADS)
def test_its_size_and_its_text_are_those_of_the_filled_graph_and_do_not_fill_it(roads):
    graph, filled = (to_digraph(network(roads, [{}, {"name": "a"}, {}]), {"resolution": 10.0}) for _ in range(2))
    list(filled)
    assert type(filled) is nx.DiGraph
    for count in COUNTS:
        assert count(graph) == count(filled)
        assert type(graph) is not nx.DiGraph
    repr(graph)
    with gamms.create_context(logger_config={"level": "ERROR"}) as ctx:
        ctx.graph.attach_networkx_graph(graph)
        assert ctx.graph.graph.crs == "EPSG:32635"
    assert type(graph) is not nx.DiGraph


def test_counting_remains_possible_after_the_graph_was_filled():
    graph = to_digraph(network([(0, 1, True, 0, False)], [{}]))
    count = graph.number_of_edges
    graph.add_edge(0, 2)
    assert count() == graph.number_of_edges() == 3


def test_changed_entries_about_the_graph_count_and_stay():
    graph = to_digraph(network([(0, 1, True, 0, False)], [{}]))
    about = graph.graph
    about["crs"] = "EPSG:32636"
    about["attribution"] = "© us"
    with gamms.create_context() as ctx:
        ctx.graph.attach_networkx_graph(graph)
        assert (ctx.graph.crs, ctx.graph.attribution) == ("EPSG:32636", "© us")
    list(graph)
    assert graph.graph is about


def test_a_graph_that_is_too_large_to_fill_stays_and_can_be_attached():
    graph = to_digraph(network([(0, 1, True, 0, False)], [{}]))
    with (
        allowing(1000),
        pytest.raises(TooLarge, match=r"Reading the 5 nodes and 2 edges of this graph as dicts of networkx"),
    ):
        graph.add_node(99)
    with gamms.create_context() as ctx:
        ctx.graph.attach_networkx_graph(graph)
        assert len(ctx.graph.graph) == 5
    assert len(list(graph)) == 5


def test_changes_after_it_was_attached_stay_in_networkx():
    graph = to_digraph(network([(0, 1, True, 0, False)], [{"name": ["a"]}]))
    with gamms.create_context() as ctx:
        ctx.graph.attach_networkx_graph(graph)
        graph.edges[0, 1]["name"].append("b")
        graph.edges[0, 1]["length"] = 1.0
        assert ctx.graph.edge_attributes(0)["name"] == ["a"]
        assert ctx.graph.graph.get_edge(0).length == 10.0
        with pytest.raises(ValueError, match="Failed to attach NetworkX graph"):
            ctx.graph.attach_networkx_graph(to_digraph(network([(0, 1, True, 0, False)], [{}])))

"""What is handed out: nodes, edges and faces are immutable values; columns are frozen for good."""

import copy
import pickle
import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely import LineString

import gamms
from gamms.graph import Graph
from gamms.graph.tables import RowIndex
from gamms.typing.graph_engine import Node, ObsFace, OSMEdge

ARRAYS = ("node_ids", "xy", "edge_ids", "sources", "targets", "lengths", "offsets", "out_edges")


@pytest.fixture
def values(any_ctx, fill):
    graph = fill(any_ctx)
    return [graph.get_node(1), graph.get_edge(1), graph.get_edge(2), any_ctx.graph.get_obstacle_face(5)]


def test_values_are_of_the_published_classes(values):
    for value, kind in zip(values, (Node, OSMEdge, OSMEdge, ObsFace), strict=True):
        assert type(value) is kind
        assert isinstance(value, getattr(gamms.typing, kind.__name__))


def test_values_are_immutable(values):
    for value in values:
        with pytest.raises(AttributeError):
            value.id = 7


def test_values_are_equal_and_hash_by_value(values):
    for value in values:
        for twin in (pickle.loads(pickle.dumps(value)), copy.copy(value), copy.deepcopy(value)):
            assert type(twin) is type(value)
            assert twin == value
            assert hash(twin) == hash(value)
            assert repr(twin) == repr(value)
    assert len({*values, *copy.deepcopy(values)}) == len(values)


def test_edges_of_other_shape_are_other_edges(values):
    straight = values[1]
    other = OSMEdge(*straight[:4], [(0, 0), (9, 9), (3, 4)])
    assert straight != other
    assert straight == OSMEdge(*straight[:4], LineString([(0, 0), (3, 4)]))
    assert straight != tuple(straight)


def test_a_value_shows_its_fields(values):
    assert repr(values[0]) == "Node(id=1, x=0.0, y=0.0)"
    assert repr(values[1]).startswith("OSMEdge(id=1, source=1, target=2, length=5.0, linestring=<LINESTRING")


def test_a_linestring_is_the_polyline(values):
    assert list(values[1].linestring.coords) == [(0.0, 0.0), (3.0, 4.0)]
    assert list(values[2].linestring.coords) == [(0.0, 0.0), (3.0, 0.0), (3.0, 4.0)]
    assert values[2].linestring is values[2].linestring


def test_a_linestring_that_is_straight_between_the_nodes_takes_no_memory(ctx):
    ctx.graph.add_nodes([7, 8, 9], [0.0, 10.0, 20.0], [0.0, 5.0, 0.0])
    graph, bent = ctx.graph.graph, [(10.0, 5.0), (20.0, 9.0), (20.0, 0.0)]
    graph.add_edge({"id": 1, "source": 8, "target": 9, "length": 1.0, "linestring": [(10.0, 5.0), (20.0, 0.0)]})
    assert not ctx.graph.columns().polylines
    graph.update_edge({"id": 1, "linestring": bent})
    assert [line.tolist() for line in ctx.graph.columns().polylines.values()] == [[list(xy) for xy in bent]]
    graph.update_edge({"id": 1, "linestring": [(10.0, 5.0), (20.0, 0.0)]})
    assert not ctx.graph.columns().polylines


def test_shapely_is_loaded_when_the_first_linestring_is_made():
    script = """
import sys, gamms
with gamms.create_context(logger_config={"level": "CRITICAL"}) as ctx:
    graph = ctx.graph.graph
    graph.add_nodes([1, 2], [0.0, 1.0], [0.0, 1.0])
    graph.add_edge({"id": 1, "source": 1, "target": 2, "length": 1, "linestring": [(0, 0), (0, 1), (1, 1)]})
    edge = graph.within(1, 5.0).edges[0]
    ctx.graph.columns(), list(graph.get_edges(1.0, 0, 0)), edge.points, graph.get_edge(1)
    assert not {"shapely", "networkx", "sqlite3"} & set(sys.modules)
    assert edge.linestring.length == 2.0
    assert "shapely" in sys.modules
"""
    subprocess.run([sys.executable, "-c", script], check=True)


# -- columns ----------------------------------------------------------------------------------------------------


def bytes_of(columns):
    return [getattr(columns, name).tobytes() for name in ARRAYS] + [
        polyline.tobytes() for polyline in columns.polylines.values()
    ]


def test_columns_know_the_crs_that_was_set_last(any_ctx, fill):
    graph = fill(any_ctx)
    assert graph.columns().crs == "EPSG:32635"
    graph.crs = "EPSG:3879"
    assert graph.columns().crs == "EPSG:3879"


EDITS = {
    "add_node": lambda g: g.add_node({"id": 99, "x": 1.0, "y": 1.0, "name": "new"}),
    "add_nodes": lambda g: g.add_nodes(range(100, 200), [0.0] * 100, [0.0] * 100),
    "add_edge": lambda g: g.add_edge({"id": 99, "source": 1, "target": 1, "length": 1.0}),
    "add_edges": lambda g: g.add_edges(range(100, 200), [1] * 100, [2] * 100),
    "move": lambda g: g.update_node({"id": 1, "x": 77.0}),
    "name": lambda g: g.update_node({"id": 2, "name": "other"}),
    "length": lambda g: g.update_edge({"id": 1, "length": 77.0}),
    "ends": lambda g: g.update_edge({"id": 2, "source": 2, "target": 1}),
    "bend": lambda g: g.update_edge({"id": 2, "linestring": [(0, 0), (7, 7), (3, 4)], "lanes": 7}),
    "remove edge": lambda g: g.remove_edge(1),
    "remove node": lambda g: g.remove_node(1),
    "clear": Graph.clear,
}


@pytest.mark.parametrize("name", EDITS)
@pytest.mark.parametrize("again", [False, True])
def test_no_edit_changes_columns_that_were_given_out(ctx, graph, fill, name, again):
    fill(ctx)
    kept = [graph.columns()]
    if again:
        graph.add_node({"id": 50, "x": 1.0, "y": 1.0})
        kept.append(graph.columns())
    before = [(bytes_of(one), copy.deepcopy((one.node_attributes, one.edge_attributes))) for one in kept]
    EDITS[name](graph)
    graph.columns()
    if name != "clear":
        graph.add_nodes(range(1000, 1100), [9.0] * 100, [9.0] * 100)
    assert [(bytes_of(one), (one.node_attributes, one.edge_attributes)) for one in kept] == before


def test_positions_belong_to_the_caller(graph):
    graph.add_nodes([1, 2], [0.0, 1.0], [0.0, 1.0])
    graph.positions([2, 1])[:] = 9.0
    graph.positions(np.array([], np.int64))
    assert graph.positions([2, 2, 1]).tolist() == [[1.0, 1.0], [1.0, 1.0], [0.0, 0.0]]
    assert graph.positions([]).shape == (0, 2)


def test_an_attribute_that_no_node_has_any_more_is_no_column(graph):
    graph.add_node({"id": 1, "x": 0.0, "y": 0.0, "name": "a"})
    graph.remove_node(1)
    assert graph.columns().node_attributes == {}


# -- finding rows -----------------------------------------------------------------------------------------------


@given(st.integers(0, 99), st.data())
@settings(max_examples=10)
def test_many_ascending_ids_are_found_like_any_others(seed, data):
    ids = np.random.default_rng(seed).choice(40_000, 4300, replace=False) - 20_000
    index, ascending = RowIndex(), np.sort(ids)
    index.add(30_000, 0)
    index.extend(ascending, 1, "a node")
    index.add(25_000, 1 + len(ascending))
    rows = {30_000: 0, **{id: row for row, id in enumerate(ascending.tolist(), 1)}, 25_000: 1 + len(ascending)}
    for id in data.draw(st.lists(st.sampled_from(sorted(rows)), max_size=20, unique=True)):
        index.remove(id)
        del rows[id]
    asked = [*rows, -30_000, 29_999, 40_000, *range(-50, 50)]
    assert [index.find_row(id) for id in asked] == [rows.get(id, -1) for id in asked]
    assert index.find_rows(np.array(list(rows)), "node").tolist() == list(rows.values())


def test_an_empty_graph_is_still_a_graph():
    assert Graph()


def test_an_edge_shows_its_published_fields_only(graph):
    graph.add_nodes([1, 2], [0.0, 3.0], [0.0, 4.0])
    graph.add_edges([7], [1], [2])
    edge = graph.get_edge(7)
    id, source, target, length, linestring = edge
    assert (id, source, target, length, linestring) == (7, 1, 2, 5.0, edge.linestring)
    assert list(edge._asdict()) == ["id", "source", "target", "length", "linestring"]
    with pytest.raises(AttributeError, match="update_edge"):
        edge.length = 3.0
    assert OSMEdge(1, 2, 3, 4.0, None).linestring is None

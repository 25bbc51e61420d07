"""A map that was opened keeps its attributes and polylines in arrays: it answers and changes as one built by hand."""

import copy
import pickle

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import gamms
from gamms.graph import Graph
from gamms.graph.storage import PackedGraph
from gamms.ir.graph import CodedValues, Polylines

NODES, EDGES = 5, 8
ROW = st.integers(0, EDGES - 1)
VALUE = st.sampled_from(["road", "path", 1.5, None, ["a", "b"]])
EDIT = st.one_of(
    st.tuples(st.just("remove_edge"), ROW),
    st.tuples(st.just("remove_node"), st.integers(0, NODES - 1)),
    st.tuples(st.just("name"), ROW, VALUE),
    st.tuples(st.just("bend"), ROW, st.booleans()),
    st.tuples(st.just("add"), ROW, VALUE),
    st.tuples(st.just("columns")),
)


def built(names, bends):
    graph = Graph()
    for id in range(NODES):
        graph.add_node({"id": id, "x": float(id), "y": float(id * id), **({"z": 2.0} if id % 2 else {})})
    for id in range(EDGES):
        u, v = id % NODES, (id * 3 + 1) % NODES
        edge = {"id": id, "source": u, "target": v, "length": 20.0, "twice": id}
        named = {"name": names[id]} if id in names else {}
        line = [(u, u * u), (id, 0.5), (v, v * v)] if id in bends else None
        graph.add_edge(edge | named | {"linestring": line})
    return graph


def edited(graph, edits):
    seen, removed = [], set()
    for verb, *rest in edits:
        edge = rest[0] if rest else None
        if verb == "columns":
            seen.append(described(graph))
        elif verb == "remove_node":
            graph.remove_node(edge)
        elif edge in list(graph.get_edges()):
            if verb == "remove_edge":
                graph.remove_edge(edge)
                removed.add(edge)
            elif verb == "name":
                graph.update_edge({"id": edge, "name": rest[1]})
            elif verb == "bend":
                graph.update_edge({"id": edge, "linestring": [(0, 0), (9, edge), (1, 1)] if rest[1] else None})
        elif verb == "add" and edge in removed and {1, 2} <= set(graph.get_nodes()):
            graph.add_edge({"id": edge, "source": 1, "target": 2, "length": 5.0, "name": rest[1]})
    return [*seen, described(graph)]


def described(graph):
    ids = list(graph.get_edges())
    edges = [(graph.get_edge(id), tuple(graph.get_edge(id).points), graph.edge_attributes(id)) for id in ids]
    nodes = [(graph.get_node(id), graph.node_attributes(id)) for id in graph.get_nodes()]
    columns = graph.columns()
    near = graph.within(next(iter(graph.get_nodes())), 9.0) if nodes else None
    return (
        edges,
        nodes,
        {name: dict(values) for name, values in columns.edge_attributes.items()},
        {name: dict(values) for name, values in columns.node_attributes.items()},
        {row: line.tolist() for row, line in columns.polylines.items()},
        near and [(edge, tuple(edge.points)) for edge in near.edges],
    )


@given(
    names=st.dictionaries(ROW, VALUE),
    bends=st.sets(ROW),
    edits=st.lists(EDIT, max_size=8),
)
def test_an_opened_map_changes_as_one_that_was_built(names, bends, edits):
    with gamms.create_context() as one, gamms.create_context() as other:
        one.graph.graph.attach_networkx_graph(built(names, bends).to_networkx())
        other.graph.storage.unpack(one.graph.storage.pack())
        columns = other.graph.graph.columns()
        assert isinstance(columns.edge_attributes["twice"], CodedValues)
        before = described(other.graph.graph)
        for copied in (copy.deepcopy(other.graph.graph), pickle.loads(pickle.dumps(other.graph.graph))):
            assert described(copied) == before
        assert edited(one.graph.graph, edits) == edited(other.graph.graph, edits)
        assert one.graph.storage.pack() == other.graph.storage.pack()
        other.graph.storage.unpack(one.graph.storage.pack())
        ids = columns.edge_ids.tolist()  # as they were
        assert dict(columns.edge_attributes["twice"]) == dict(enumerate(ids))


def test_columns_by_row_read_like_dicts():
    values = CodedValues(np.array([1, 4]), np.array([1, 1]), ["a", "b"])
    assert dict(values) == values == {1: "b", 4: "b"}
    assert (values.get(4), values.get(2), values.get("4"), values.get(np.int64(1))) == ("b", None, None, "b")
    assert (list(values), list(values.values()), list(values.items())) == ([1, 4], ["b", "b"], [(1, "b"), (4, "b")])
    assert (1 in values, 0 in values, 2**70 in values, len(values)) == (True, False, False, 2)
    with pytest.raises(KeyError):
        values[0]
    shapes = Polylines(np.array([0, 1]), np.array([0, 2]), np.array([2, 5]), np.arange(10.0).reshape(5, 2))
    assert {row: line.tolist() for row, line in shapes.items()} == {0: [[0, 1], [2, 3]], 1: [[4, 5], [6, 7], [8, 9]]}
    assert [(i, len(line)) for i, line in shapes.find_among(np.array([7, 1, 0]))] == [(1, 3), (2, 2)]
    assert shapes.get(2) is None


def test_a_packed_graph_makes_no_object_for_each_edge(ctx):
    ctx.graph.attach_networkx_graph(built({0: "road"}, {3}).to_networkx())
    columns = PackedGraph(ctx.graph.storage.pack()).columns()
    assert isinstance(columns.polylines, Polylines)
    assert columns.polylines.points.flags.writeable is False

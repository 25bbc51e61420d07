"""What an edit promises: all or nothing, plain values, nothing of the caller's changed or kept."""

import copy
import math

import numpy as np
import pytest
import shapely

from gamms.errors import BadType, BadValue, GammsError, UnknownName

TOO_LARGE = [2**63, -(2**63) - 1, np.uint64(2**64 - 1)]
BAD_NUMBERS = [("1", TypeError), (None, TypeError), (True, TypeError), (1j, TypeError)]
BAD_NUMBERS += [(number, ValueError) for number in (math.nan, math.inf, -math.inf, np.float64("nan"))]


@pytest.fixture
def refused(graph, ctx, fill, everything):
    """Makes a call on a filled graph that must fail, and change nothing."""
    fill(ctx)

    def refused(error, verb, *arguments):
        before, revision, given = everything(ctx), graph.revision, repr(arguments)
        with pytest.raises(error) as caught:
            getattr(graph, verb)(*arguments)
        assert isinstance(caught.value, GammsError)
        assert (everything(ctx), graph.revision, repr(arguments)) == (before, revision, given)
        return str(caught.value)

    return refused


EDGE = {"id": 9, "source": 1, "target": 2, "length": 1.0}


@pytest.mark.parametrize("id", TOO_LARGE)
def test_an_id_fits_into_64_bits(refused, id):
    refused(ValueError, "add_node", {"id": id, "x": 0.0, "y": 0.0})
    refused(ValueError, "add_edge", EDGE | {"id": id})
    refused(ValueError, "get_node", id)
    refused((ValueError, TypeError), "add_nodes", [id], [0.0], [0.0])


@pytest.mark.parametrize(("number", "error"), BAD_NUMBERS, ids=repr)
def test_a_coordinate_or_length_is_a_finite_number(refused, number, error):
    refused(error, "add_node", {"id": 9, "x": number, "y": 0.0})
    refused(error, "add_node", {"id": 9, "x": 0.0, "y": number, "new": 1})
    refused(error, "update_node", {"id": 2, "x": 9.0, "y": number, "name": "changed"})
    refused(error, "add_edge", EDGE | {"length": number})
    refused(error, "update_edge", {"id": 2, "target": 1, "length": number, "lanes": 9})
    refused(error, "add_nodes", [8, 9], [1.0, 2.0], [number] * 2)
    refused(error, "add_edges", [8, 9], [1, 1], [2, 2], [number] * 2)


@pytest.mark.parametrize("key", ["id", "x", "y"])
def test_a_node_needs_its_keys(refused, key):
    data = {"id": 9, "x": 0.0, "y": 0.0, "name": "new"}
    del data[key]
    assert repr(key) in refused(ValueError, "add_node", data)


@pytest.mark.parametrize(
    ("key", "error"), {"id": ValueError, "length": ValueError, "source": KeyError, "target": KeyError}.items()
)
def test_an_edge_needs_its_keys(refused, key, error):
    data = dict(EDGE)
    del data[key]
    assert f"needs the key {key!r}" in refused(error, "add_edge", data)


@pytest.mark.parametrize(
    ("place", "error"),
    [
        ((5, math.inf, 0), BadValue),
        ((5, 0, -math.inf), BadValue),
        ((math.nan, 0, 0), BadValue),
        ((-1, math.nan, 0), BadValue),
        ((math.inf, 0, math.nan), BadValue),
        (("5", 0, 0), BadType),
        ((5, None, 0), BadType),
        ((5, 10**400, 0), BadType),
    ],
)
def test_a_place_is_two_finite_numbers(refused, ctx, place, error):
    for verb in ("get_nodes", "get_edges"):
        refused(error, verb, *place)
    with pytest.raises(error):
        ctx.graph.get_obstacle_faces(*place)


def test_everywhere_is_everywhere_around_any_place(graph, fill, ctx):
    fill(ctx)
    for d in (-1, math.inf):
        assert list(graph.get_nodes(d, math.inf, 0)) == [1, 2, -7, 40]


def test_missing_nodes_and_edges_are_not_found(refused):
    for verb in ("get_node", "get_edge", "get_neighbors", "remove_edge", "node_attributes", "edge_attributes"):
        refused(UnknownName, verb, 99)
    refused(UnknownName, "within", 99, 1.0)
    refused(UnknownName, "positions", [1, 99])


@pytest.mark.parametrize(
    "line", [[], [(0, 0)], [(0, 0), (1,)], [(0, 0), (math.nan, 1)], 7, "ab", ["12", "34"], object()]
)
def test_a_linestring_is_a_polyline(refused, line):
    refused(ValueError, "add_edge", EDGE | {"linestring": line})
    refused(ValueError, "update_edge", {"id": 2, "length": 9.0, "linestring": line})


def test_a_shape_of_another_kind_is_no_linestring(refused):
    shapes = (
        shapely.LineString(),
        shapely.Point(1, 1),
        shapely.box(0, 0, 1, 1),
        shapely.MultiLineString([[(0, 0), (1, 1)]]),
    )
    for shape in shapes:
        refused(ValueError, "add_edge", EDGE | {"linestring": shape})


@pytest.mark.parametrize("verb", ["add_node", "add_edge", "update_node", "update_edge"])
def test_a_record_is_a_dict_with_names(refused, verb):
    for record in (None, 5, [1, 2], "node"):
        refused(TypeError, verb, record)
    id = 9 if "add" in verb else 2
    refused(TypeError, verb, {**EDGE, "id": id, "x": 0.0, "y": 0.0, 5: 1})


def test_columns_of_new_rows_are_equally_long(refused):
    refused(ValueError, "add_nodes", [8, 9], [0.0], [0.0, 1.0])
    refused(ValueError, "add_nodes", [8, 9], [0.0, 1.0], 5.0)
    refused(ValueError, "add_nodes", [[8, 9]], [0.0, 1.0], [0.0, 1.0])
    refused(ValueError, "add_edges", [8, 9], [1], [2, 2])
    refused(ValueError, "add_edges", [8, 9], [1, 1], [2, 2], [1.0])


@pytest.mark.parametrize("ids", [[1.0], ["1"], [True], [None]])
def test_columns_of_ids_hold_integers(refused, ids):
    refused(TypeError, "add_nodes", ids, [0.0], [0.0])
    refused(TypeError, "add_edges", [9], ids, [1])
    refused(TypeError, "positions", ids)


def test_a_callers_dict_is_neither_changed_nor_kept(any_ctx):
    graph = any_ctx.graph.graph
    node, other = {"id": 1, "x": 1, "y": 2, "name": "a"}, {"id": 2, "x": 0.0, "y": 0.0}
    line = [[1.0, 2.0], [5.0, 5.0], [0.0, 0.0]]
    edge = {"id": 1, "source": 1, "target": 2, "length": 3, "linestring": line, "lanes": 2}
    given = [node, other, edge]
    before = copy.deepcopy(given)
    graph.add_node(node)
    graph.add_node(other)
    graph.add_edge(edge)
    graph.update_node(node)
    graph.update_edge(edge)
    assert given == before
    seen = (graph.get_node(1), graph.get_edge(1).points, graph.node_attributes(1), graph.edge_attributes(1))
    node.update(id=7, x=99, name="b")
    edge.update(length=99, target=1, lanes=0)
    line[1][0] = 99.0
    graph.node_attributes(1).clear()
    assert seen == (graph.get_node(1), graph.get_edge(1).points, graph.node_attributes(1), graph.edge_attributes(1))


def test_callers_arrays_are_not_kept(graph):
    ids, x, y = np.arange(3), np.zeros(3), np.zeros(3)
    graph.add_nodes(ids, x, y)
    for array in (ids, x, y):
        array[:] = 9
    assert [graph.get_node(id) for id in graph.get_nodes()] == [(0, 0.0, 0.0), (1, 0.0, 0.0), (2, 0.0, 0.0)]


def test_a_missing_node_has_no_neighbors_at_the_call(graph):
    with pytest.raises(KeyError, match="5"):
        graph.get_neighbors(5)
    with pytest.raises(KeyError, match="5"):
        graph.neighborhoods[5]


def test_a_removed_node_has_no_neighborhood_any_more(graph):
    graph.add_nodes(range(9), [0.0] * 9, [0.0] * 9)
    graph.add_edges([0, 1], [1, 2], [2, 3])
    assert [list(graph.neighborhoods[id]) for id in (0, 1, 2)] == [[0], [1, 2], [2, 3]]
    for id in (0, 2):
        graph.remove_node(id)
        with pytest.raises(KeyError, match=str(id)):
            graph.neighborhoods[id]
    assert list(graph.neighborhoods[1]) == [1]

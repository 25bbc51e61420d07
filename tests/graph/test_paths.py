"""Ways through a graph: the shortest ones, by networkx's measure, however often and after whatever edits."""

import math

import networkx as nx
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gamms import osm
from gamms.errors import BadType, BadValue, NoPath, NotOffered, UnknownName
from gamms.graph import Graph, routes, store
from gamms.graph.store import Cache
from gamms.typing import IGraph
from gamms.typing import routes as typing_routes

IDS = (4, -2, 9, 0, 31, 7)
EDGES = st.lists(
    st.tuples(st.sampled_from(IDS), st.sampled_from(IDS), st.integers(0, 9), st.none() | st.integers(0, 5)), max_size=20
)
WEIGHTS = ("length", "toll", None)


class Slow(Graph):
    """A foreign graph, with the defaults of the contract."""

    weights = IGraph.weights
    shortest_path = IGraph.shortest_path
    _get_routes = IGraph._get_routes
    distance = IGraph.distance
    distances = IGraph.distances
    distance_matrix = IGraph.distance_matrix
    to_latlon = IGraph.to_latlon
    from_latlon = IGraph.from_latlon
    nearest_node = IGraph.nearest_node
    place = IGraph.place


def build(edges, kind=Graph):
    graph, reference = kind(), nx.MultiDiGraph()
    graph.add_nodes(IDS, [0.0] * len(IDS), [0.0] * len(IDS))
    reference.add_nodes_from(IDS)
    for id, (source, target, length, toll) in enumerate(edges):
        given = {} if toll is None and id else {"toll": toll or 0}  # one edge has it
        graph.add_edge({"id": id, "source": source, "target": target, "length": length, **given})
        reference.add_edge(source, target, length=length, **given)
    return graph, reference


@pytest.fixture
def square():
    """1 - 2 - 4 and 1 - 3 - 4 are equally long; 4 - 5 is one-way; 6 is alone."""
    graph = Graph()
    graph.add_nodes([1, 3, 2, 4, 5, 6], [0, 1, 0, 1, 2, 9], [0, 0, 1, 1, 1, 9])
    both = [(1, 2), (1, 3), (2, 4), (3, 4)]
    ends = [*both, *((v, u) for u, v in both), (4, 5)]
    graph.add_edges(range(9), *zip(*ends, strict=True))
    return graph


# -- laws -------------------------------------------------------------------------------------------------------


@given(
    edges=EDGES, weight=st.sampled_from(WEIGHTS), most=st.integers(1, 7), ends=st.tuples(*[st.sampled_from(IDS)] * 2)
)
def test_a_path_that_is_cut_off_is_the_beginning_of_the_whole(edges, weight, most, ends):
    graph, _ = build(edges)
    if math.isfinite(graph.distance(*ends, weight)):
        path = graph.shortest_path(*ends, weight)
        assert graph.shortest_path(*ends, weight, most_edges=most) == path[: most + 1]
        if weight != "toll":  # which the slow default does not read
            assert build(edges, Slow)[0].shortest_path(*ends, weight, most_edges=most) == path[: most + 1]


@given(edges=EDGES, weight=st.sampled_from(WEIGHTS))
def test_distances_equal_those_of_networkx(edges, weight):
    graph, reference = build(edges)
    for node in IDS:
        known = nx.single_source_dijkstra_path_length(reference, node, weight=weight or (lambda *_: 1))
        assert graph.distances(source=node, weight=weight) == known
        assert list(graph.distances(source=node, weight=weight)) == [id for id in IDS if id in known]
        known = nx.single_source_dijkstra_path_length(reference.reverse(), node, weight=weight or (lambda *_: 1))
        assert graph.distances(target=node, weight=weight) == known
        assert [graph.distance(id, node, weight) for id in IDS] == [known.get(id, math.inf) for id in IDS]


@given(edges=EDGES, weight=st.sampled_from(WEIGHTS))
def test_a_path_is_shortest_and_the_first_of_the_equally_short_ones(edges, weight):
    graph, reference = build(edges)
    for source in IDS:
        for target in IDS:
            way = weight or (lambda *_: 1)
            if not nx.has_path(reference, source, target):
                with pytest.raises(NoPath, match=f"from node {source} to node {target}"):
                    graph.shortest_path(source, target, weight)
                continue
            known = (
                list(nx.all_shortest_paths(reference, source, target, weight=way)) if source != target else [[source]]
            )
            assert graph.shortest_path(source, target, weight) == min(known, key=lambda path: (len(path), path))


@given(edges=EDGES, weight=st.sampled_from(["length", None]), cutoff=st.sampled_from([None, 0, 4.0]))
def test_the_defaults_of_the_contract_answer_alike(edges, weight, cutoff):
    (graph, _), (slow, _) = build(edges), build(edges, Slow)
    assert graph.weights(weight).tolist() == slow.weights(weight).tolist()
    matrices = [one.distance_matrix(IDS[:4], IDS[2:], weight).tobytes() for one in (graph, slow)]
    assert matrices[0] == matrices[1]
    some = list(IDS[:2])
    for ends in ({"source": IDS[0]}, {"target": IDS[1]}, {"source": some}, {"target": some}):
        assert graph.distances(**ends, weight=weight, cutoff=cutoff) == slow.distances(
            **ends, weight=weight, cutoff=cutoff
        )
    for target in IDS:
        assert graph.distance(IDS[0], target, weight) == slow.distance(IDS[0], target, weight)
        try:
            path = graph.shortest_path(IDS[0], target, weight)
        except NoPath:
            with pytest.raises(NoPath):
                slow.shortest_path(IDS[0], target, weight)
        else:
            assert slow.shortest_path(IDS[0], target, weight) == path


@given(edges=EDGES)
def test_a_matrix_holds_every_distance(edges):
    graph, _ = build(edges)
    sources, targets = [4, 9, 4], np.array([0, 7, -2, 31])
    for rows, columns in ((sources, targets), (targets, sources)):
        matrix = graph.distance_matrix(rows, columns)
        assert matrix.shape == (len(rows), len(columns))
        assert matrix.tolist() == [[graph.distance(int(u), int(v)) for v in columns] for u in rows]


@given(edges=EDGES, edits=st.lists(st.integers(0, 19), min_size=1, max_size=4))
def test_an_edit_is_never_answered_from_memory(edges, edits):
    graph, _ = build(edges)
    left = dict(enumerate(edges))
    for edit in edits:
        for node in IDS:
            graph.distances(target=node)
            graph.distance(IDS[0], node)
        if edit in left:
            graph.remove_edge(edit)
            del left[edit]
        for id, edge in left.items():
            graph.update_edge({"id": id, "length": edge[2] + edit})
            left[id] = (*edge[:2], edge[2] + edit, edge[3])
        fresh, _ = build(left.values())
        assert [graph.distance(IDS[0], node) for node in IDS] == [fresh.distance(IDS[0], node) for node in IDS]
        assert [graph.distances(target=node) for node in IDS] == [fresh.distances(target=node) for node in IDS]


# -- examples ---------------------------------------------------------------------------------------------------


def test_several_sources_or_targets_are_answered_by_the_nearest(square):
    assert square.distances(source=[2, 5]) == {1: 1, 3: 2, 2: 0, 4: 1, 5: 0}
    assert square.distances(target=np.array([3, 5])) == {1: 1, 3: 0, 2: 2, 4: 1, 5: 0}
    assert square.distances(target={3}) == square.distances(target=3)
    assert square.distances(source=[]) == {}
    assert square.distance_matrix([], [1]).shape == (0, 1)


def test_a_cutoff_leaves_out_farther_nodes(square):
    assert square.distances(source=1, cutoff=1) == {1: 0, 3: 1, 2: 1}
    assert square.distances(source=1, cutoff=np.inf) == square.distances(source=1)
    with pytest.raises(BadValue, match="cutoff"):
        square.distances(source=1, cutoff=-1)


def test_an_edge_without_the_attribute_counts_one_and_an_infinite_one_is_closed(square):
    square.update_edge({"id": 0, "travel_time": 0.5})
    square.update_edge({"id": 8, "travel_time": math.inf})
    assert square.weights("travel_time").tolist() == [0.5, *[1.0] * 7, math.inf]
    assert square.distance(1, 4, "travel_time") == 1.5
    assert square.distance(1, 5, "travel_time") == math.inf
    with pytest.raises(ValueError, match="from node 1 to node 5"):
        square.shortest_path(1, 5, "travel_time")


@pytest.mark.parametrize("weight", [lambda u, v, data: 1, 3, ("a",)])
def test_a_weight_is_a_name(square, weight):
    with pytest.raises(BadType, match="name of an edge attribute"):
        square.distance(1, 5, weight)


@pytest.mark.parametrize("kind", [Graph, Slow])
def test_unknown_nodes_are_named(kind):
    graph, _ = build([(4, 9, 1, None)], kind)
    for call in (
        lambda: graph.shortest_path(4, 99),
        lambda: graph.shortest_path(99, 4),
        lambda: graph.shortest_path(99, 99),
        lambda: graph.distance(4, 99),
        lambda: graph.distances(source=99),
        lambda: graph.distances(target=[4, 99]),
        lambda: graph.distance_matrix([4], [99]),
    ):
        with pytest.raises(UnknownName, match="99"):
            call()
    for bad in ("4", 4.0, True):
        with pytest.raises(TypeError):
            graph.shortest_path(4, bad)
        with pytest.raises(TypeError):
            graph.distances(source=bad)
    for ends in ({}, {"source": 4, "target": 9}):
        with pytest.raises(BadValue, match="exactly one of source= and target="):
            graph.distances(**ends)


def test_a_default_that_knows_no_attributes_or_places_says_so():
    graph, _ = build([(4, 9, 1, None)], Slow)
    with pytest.raises(BadValue, match="override `weights`"):
        graph.shortest_path(4, 9, "toll")
    for call in (
        lambda: graph.nearest_node(0, 0),
        lambda: graph.place(1),
        lambda: graph.to_latlon(0, 0),
        lambda: graph.from_latlon(lat=0, lon=0),
    ):
        with pytest.raises(NotOffered, match="Slow does not offer"):
            call()


# -- what is remembered -----------------------------------------------------------------------------------------


def table(size):
    return (np.zeros(size, np.uint8),)


def test_memory_is_bounded_and_the_oldest_goes_first():
    each = store._ENTRY_BYTES + 40
    kept, made = Cache(2 * each + 20), []

    def ask(key, revision=1, size=40):
        def make():
            made.append(key)
            return table(size)

        return kept.get(revision, key, make)

    for key in ("a", "b", "a", "c", "a", "b"):
        ask(key)
        assert kept.bytes <= 2 * each + 20
    assert made == ["a", "b", "c", "b"]
    ask("too large", size=each + 61)
    ask("too large", size=each + 61)
    ask("a", revision=2)
    assert made[4:] == ["too large", "too large", "a"]
    assert kept.bytes == each
    assert store._count_bytes(table(7)) == store._ENTRY_BYTES + 7


def test_many_targets_stay_within_the_bound(monkeypatch):
    monkeypatch.setattr(routes, "_MOST_BYTES", 4096)
    graph = Graph()
    graph.add_nodes(range(50), range(50), [0] * 50)
    graph.add_edges(range(98), [*range(49), *range(1, 50)], [*range(1, 50), *range(49)])
    for _ in range(2):
        for target in range(50):
            assert graph.distance(0, target) == target
            assert len(graph.shortest_path(49, target)) == 50 - target
            assert graph._routes.cache.bytes <= 4096


def test_a_weight_that_no_edge_has_is_refused_with_those_that_there_are(ctx):
    ctx.graph.add_nodes([1, 2], [0.0, 5.0], [0.0, 0.0])
    ctx.graph.add_edges([7], [1], [2])
    ctx.graph.graph.update_edge({"id": 7, "travel_time": 3.0})
    for misspelt in ("lenght", "travel_tme"):
        with pytest.raises(KeyError, match=r"Unknown weight .* Did you mean"):
            ctx.graph.shortest_path(1, 2, weight=misspelt)
    with pytest.raises(KeyError, match=r"Unknown weight 'beauty'. There are: 'length', 'travel_time'."):
        ctx.graph.distance(1, 2, weight="beauty")
    ctx.graph.graph.remove_edge(7)
    assert ctx.graph.distance(1, 1, weight="beauty") == 0.0


def test_an_unknown_mode_of_turns_is_refused_on_a_map_without_restrictions(square):
    start, end = [*square.get_nodes()][:2]
    with pytest.raises(UnknownName, match="Unknown mode of travel 'drvie'"):
        square.distance(start, end, turns="drvie")
    assert square.distance(start, end, turns="drive") == square.distance(start, end, turns="truck")


def test_the_modes_that_come_with_the_library_are_known_to_routes():
    assert {*typing_routes._SHIPPED_MODES} == {*osm.modes()}

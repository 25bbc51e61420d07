"""How far agents get by metres: what is kept of it is what a search says that keeps nothing."""

from math import inf

import pytest
from hypothesis import given
from hypothesis import strategies as st

import gamms
from gamms.errors import BadValue
from gamms.game import travel
from gamms.game.travel import SLACK, Roads
from gamms.graph import Graph

IDS = [5, 3, 8, 1, 9, 2]
LENGTHS = st.sampled_from([0.0, 3.0, 7.0, 10.0, 1.0 / 3.0])
EDGES = st.lists(st.tuples(st.sampled_from(IDS), st.sampled_from(IDS), LENGTHS), min_size=1, max_size=18)


def roads_of(edges, seconds=None):
    graph = Graph()
    graph.add_nodes(IDS, [0.0] * len(IDS), [0.0] * len(IDS))
    graph.add_edges(range(len(edges)), *zip(*edges, strict=True))
    columns = graph.columns()
    return graph, Roads(graph, columns, "length", seconds, 2.0)


def reached_from(roads, edges, node, speed, begun, left):
    """Node -> when it is reached, in the order of the times and then of the ids: one node settled after the other."""
    times, found = {node: begun}, {}
    while times:
        at = min(times, key=lambda one: (times[one], one))
        found[at] = times.pop(at)
        for id, (source, target, _) in enumerate(edges):
            then = found[at] + roads.turns(roads.on(id), 1.0, speed)
            if source == at and target not in found and then <= left + SLACK:
                times[target] = min(then, times.get(target, inf))
    return found


@given(
    edges=EDGES,
    looks=st.lists(
        st.tuples(st.sampled_from(IDS), st.sampled_from([0.0, 1.0, 3.5, 5.0, inf]), st.sampled_from([0.0, 0.1, 0.7])),
        min_size=1,
        max_size=6,
    ),
    left=st.sampled_from([1.0, 0.6, 0.35]),
    are_slow=st.booleans(),
    most=st.sampled_from([3, 1 << 17]),
)
def test_nodes_in_reach_are_those_of_a_plain_search_whatever_is_kept(edges, looks, left, are_slow, most):
    graph, roads = roads_of(edges, [1.5] * len(edges) if are_slow else None)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(travel, "_MOST_KEPT", most)
        for node, speed, begun in looks:
            direct = reached_from(roads, edges, node, speed, begun, left)
            assert list(roads.around(node, speed, begun, left).items()) == list(direct.items())
            legal, nodes, times = roads.reached(node, speed)
            direct = reached_from(roads, edges, node, speed, 0.0, 1.0)
            assert list(zip(nodes, times, strict=True)) == list(direct.items())
            assert legal == tuple(dict.fromkeys([*graph.neighborhoods[node], *direct]))
            assert roads._kept <= max(most, len(legal))


@given(
    edges=EDGES,
    pairs=st.lists(st.tuples(st.sampled_from(IDS), st.sampled_from(IDS)), min_size=1, max_size=12),
    most=st.sampled_from([3, 1 << 17]),
)
def test_paths_and_distances_are_those_of_the_graph_whatever_is_kept(edges, pairs, most):
    graph, roads = roads_of(edges)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(travel, "_MOST_KEPT", most)
        for source, target in pairs:
            far = graph.distance(source, target, "length")
            assert roads.distance(source, target) == far
            if far < inf:
                assert [source, *roads.path(source, target)] == graph.shortest_path(source, target, "length")
            else:
                with pytest.raises(BadValue, match=f"from node {source} to node {target}"):
                    list(roads.path(source, target))


@given(edges=EDGES)
def test_of_parallel_edges_the_first_of_the_cheapest_is_taken_and_the_first_that_is_as_long_leads_back(edges):
    _, roads = roads_of(edges)
    for id, (source, target, length) in enumerate(edges):
        cheapest = min(far for one, other, far in edges if (one, other) == (source, target))
        assert roads.road(source, target).edge == edges.index((source, target, cheapest))
        back = (target, source, length)
        assert getattr(roads.back(roads.on(id)), "edge", None) == (edges.index(back) if back in edges else None)


def test_an_agent_without_a_bound_of_its_own_keeps_to_the_speeds_of_edges():
    game = {"speed_unit": "metres_per_second", "weight": "travel_time"}
    with gamms.create_context(seed=1, logger_config={"level": "CRITICAL"}, game=game) as ctx:
        ctx.graph.add_nodes([0, 1, 2], [0.0, 200.0, 400.0], [0.0] * 3)
        for id in (0, 1):
            edge = {"id": id, "source": id, "target": id + 1, "length": 200.0, "travel_time": 2.0}
            ctx.graph.graph.add_edge(edge)
        car = ctx.agent.create_agent("car", start_node_id=0, speed=inf, strategy=lambda state: state.update(action=2))
        places = []
        for _ in range(4):
            ctx.game.step()
            places.append((car.current_node_id, car.offset_m))
    assert places == [(0, 100.0), (1, 0.0), (1, 100.0), (2, 0.0)]

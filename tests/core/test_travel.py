"""Travel by metres: what agents reach is what a plain search finds, and what they cover adds up."""

from itertools import chain, pairwise
from math import inf, nan

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gamms.core import travel as core
from gamms.game.travel import ENDLESS, ReachableNodes, TurnPaths, map_of
from gamms.graph import Graph
from gamms.ir.progress import Motion

IDS = [5, 3, 8, 1, 9, 2]
NODES = st.integers(0, len(IDS) - 1)
LENGTHS = st.sampled_from([0.0, 3.0, 7.0, 10.0, 1.0 / 3.0, 1e300, 5e-324])
EDGES = st.lists(st.tuples(NODES, NODES, LENGTHS), min_size=1, max_size=18)
SPEEDS = st.sampled_from([0.0, 1.0, 3.5, 5.0, 5e-324, 1e300, inf])
SHARES = st.sampled_from([5e-324, 0.25, 1.0 / 3.0, 1.0 - 2.0**-53])
SLACK, TURN = 1e-9, 2.0  # of a turn, and seconds


def columns_of(edges):
    graph = Graph()
    graph.add_nodes(IDS, [0.0] * len(IDS), [0.0] * len(IDS))
    graph.add_edges(range(len(edges)), *zip(*[(IDS[a], IDS[b], far) for a, b, far in edges], strict=True))
    return graph.columns()


def map_on(edges, seconds=None):
    columns = columns_of(edges)
    return map_of(columns, columns.lengths, seconds and np.full(len(edges), seconds), TURN)


def patched_map(edges, nodes):
    """The same map, of which some nodes are listed with their edges once more."""
    columns = columns_of(edges)
    leaving = [[row for row, edge in enumerate(edges) if edge[0] == node] for node in range(len(IDS))]
    kept = [[] if node in nodes else leaving[node] for node in range(len(IDS))]
    offsets = [0, *np.cumsum([len(one) for one in kept])]
    patch = [leaving[node] for node in nodes]
    ends = [0, *np.cumsum([len(one) for one in patch])]
    rows = [np.array([*chain(*part)], np.int64) for part in (kept, patch)]
    return map_of(columns, columns.lengths, None, TURN, (offsets, rows[0]), (np.array(nodes, np.int64), ends, rows[1]))


def turns_of(length, speed, seconds):
    by_speed = 0.0 if speed == inf or length == 0.0 else length / (speed * TURN) if speed * TURN > 0.0 else inf
    return max(by_speed, (seconds or 0.0) / TURN)


def around(edges, starts, speed, seconds, latest):
    """Rows of nodes by when they are reached, then by id: one node is settled after the other."""
    times, found = dict(starts), []
    while times:
        at = min(times, key=lambda one: (times[one], IDS[one]))
        now = times.pop(at)
        found.append(at)
        for source, target, length in edges:
            then = now + turns_of(length, speed, seconds)
            if source == at and target not in found and then <= latest:
                times[target] = min(then, times.get(target, inf))
    return found


def near(edges, node):
    return [node, *(target for source, target, _ in edges if source == node)]


def reached(roads, node, *more):
    reach = ReachableNodes(len(IDS))
    for _ in range(2):  # what one search leaves does not matter to the next
        count = core.reachable(roads, reach.core, node, *more)
    return reach.nodes[:count].tolist()


@given(
    edges=EDGES, node=NODES, speed=SPEEDS, now=st.sampled_from([0.0, 0.4, 0.65]), seconds=st.sampled_from([None, 1.5])
)
def test_on_a_node_legal_are_those_next_to_it_then_those_in_reach(edges, node, speed, now, seconds):
    found = around(edges, {node: 0.0}, speed, seconds, 1.0 - now + SLACK)
    if speed == inf and seconds is None:
        found.sort()
    legal = list(dict.fromkeys([*near(edges, node), *found]))
    assert reached(map_on(edges, seconds), node, -1, 0.0, 0, speed, now, False) == legal
    assert reached(map_on(edges, seconds), node, -1, 0.0, 0, nan, now, False) == list(dict.fromkeys(near(edges, node)))


def ways_on(edges, most):
    """The map, on which an agent remembers so many nodes of its way, and a graph that says what its way is."""
    graph = Graph()
    graph.add_nodes(IDS, [0.0] * len(IDS), [0.0] * len(IDS))
    graph.add_edges(range(len(edges)), *zip(*[(IDS[a], IDS[b], far) for a, b, far in edges], strict=True))
    ints, reach = np.zeros((3, 1), np.int64), ReachableNodes(len(IDS))
    ints[0] = -1
    columns = *ints, np.zeros(most, np.int64), np.zeros(most)
    direct = np.zeros(len(edges), np.uint8).data
    maps = map_on(edges), map_on([(b, a, far) for a, b, far in edges])
    return core.GoalPaths(*maps, reach.core, direct, most, *(column.data for column in columns)), graph


@given(edges=EDGES, asked=st.lists(st.tuples(NODES, NODES), min_size=1, max_size=4), most=st.integers(2, 7))
def test_agents_remember_the_way_that_the_graph_gives(edges, asked, most):
    ways, graph = ways_on(edges, most)
    for source, goal in asked:
        far = graph.distance(IDS[source], IDS[goal])
        assert core.distance(ways, 0, source, goal) == far
        way = [source]
        while (node := core.following(ways, 0, way[-1], goal)) != way[-1]:
            way.append(node)
        path = graph.shortest_path(IDS[source], IDS[goal]) if far < inf else [IDS[source]]
        assert [IDS[node] for node in way] == path


@given(edges=EDGES, source=NODES, goal=NODES, most=st.integers(2, 7))
def test_a_route_has_the_next_nodes_of_the_way(edges, source, goal, most):
    ways, graph = ways_on(edges, most)
    trips = TurnPaths(1, 8)
    assert core.put_route(ways, trips.core, 0, source, goal, 1) == 1 + core.put_route(
        ways, trips.core, 0, source, goal, 0
    )
    count = core.put_route(ways, trips.core, 0, source, goal, 0)
    far = graph.distance(IDS[source], IDS[goal])
    path = graph.shortest_path(IDS[source], IDS[goal]) if far < inf else [IDS[source]]
    found = [IDS[node] for node in trips.route[:count].tolist()]
    assert found == path[1 : 1 + count]
    assert count > 0 or source == goal or far == inf


@given(data=st.data(), edges=EDGES, share=SHARES, speed=SPEEDS, goes_on=st.booleans(), motion=st.sampled_from(Motion))
def test_on_an_edge_legal_is_what_lies_beyond_its_ends(data, edges, share, speed, goes_on, motion):
    edge = data.draw(st.integers(0, len(edges) - 1))
    roads, (source, target, length) = map_on(edges), edges[edge]
    ends = {target: (1.0 - share) * length}
    may_turn = any(one[:2] == (target, source) and abs(one[2] - length) <= SLACK * length for one in edges)
    if goes_on and (motion == Motion.FORWARD or (motion == Motion.BACK and may_turn)):
        ends = {source: share * length} if motion == Motion.BACK else ends
        legal = []
    else:
        legal = [source, target] if may_turn else [target]
        ends = ends | {source: min(share * length, ends.get(source, inf))} if may_turn else ends
    if may_turn and source == target:
        return  # of both ways to the one node, each is searched
    legal += [other for end in ends for other in near(edges, end)]
    for end, metres in ends.items():
        found = around(edges, {end: turns_of(metres, speed, None)}, speed, None, 1.0 + SLACK)
        legal += sorted(found) if speed == inf else found
    assert reached(roads, source, edge, share, motion, speed, 0.0, goes_on) == list(dict.fromkeys(legal))


@given(edges=EDGES, nodes=st.sets(NODES).map(sorted), node=NODES, speed=SPEEDS)
def test_edges_of_other_maps_are_found_in_their_order(edges, nodes, node, speed):
    maps = map_on(edges), patched_map(edges, nodes)
    legal = [reached(roads, node, -1, 0.0, 0, speed, 0.0, False) for roads in maps]
    assert legal[0] == legal[1]
    for pair in [(one, other) for one in range(len(IDS)) for other in range(len(IDS))]:
        assert core.cheapest(maps[0], *pair) == core.cheapest(maps[1], *pair)


@given(edges=EDGES)
def test_of_parallel_edges_the_first_of_the_cheapest_is_taken_and_the_first_that_is_as_long_leads_back(edges):
    roads = map_on(edges)
    assert core.cheapest(map_on([(0, 1, 3.0)]), 1, 0) == -1
    for row, (source, target, length) in enumerate(edges):
        cheapest = min(far for one, other, far in edges if (one, other) == (source, target))
        assert core.cheapest(roads, source, target) == edges.index((source, target, cheapest))
        back = (target, source, length)
        assert core.back(roads, row) == (edges.index(back) if back in edges else -1)


@pytest.mark.parametrize(
    ("ahead", "behind", "motion"),
    [
        (10.0, 20.0, Motion.FORWARD),
        (10.0, 4.0, Motion.BACK),
        (10.0, 5.0, Motion.FORWARD),
        (inf, inf, 0),
        (inf, 0.0, Motion.BACK),
    ],
)
def test_an_agent_on_an_edge_goes_the_shorter_way_and_of_equal_ones_the_one_on(ahead, behind, motion):
    roads = map_on([(0, 1, 10.0), (1, 0, 10.0), (1, 2, 10.0)])
    assert core.shorter_way(roads, 0, 0.75, ahead, behind) == motion
    assert core.shorter_way(roads, 2, 0.75, ahead, behind) == (Motion.FORWARD if ahead < inf else 0)


@given(
    data=st.data(),
    edges=EDGES,
    speed=SPEEDS | st.just(nan),
    now=st.sampled_from([0.0, 0.4, 1.0 - 1e-13]),
    start=st.none() | SHARES,
    left=st.sampled_from([1, ENDLESS]),
    seconds=st.sampled_from([None, 1.5]),
)
def test_what_agents_cover_adds_up_to_speed_times_time(data, edges, speed, now, start, left, seconds):
    roads, trips = map_on(edges, seconds), TurnPaths(1, 64)
    node, edge, motion = data.draw(NODES), -1, Motion.FORWARD
    if start is not None:
        edge = data.draw(st.integers(0, len(edges) - 1))
        node, at, _ = edges[edge]
        if core.back(roads, edge) >= 0:
            motion = data.draw(st.sampled_from([Motion.FORWARD, Motion.BACK]))
            at = node if motion == Motion.BACK else at
    else:
        at = node
    first, route = node, []
    while len(route) < 8 and (ways := [target for source, target, _ in edges if source == at]):
        at = data.draw(st.sampled_from(ways))
        route.append(at)
    trips.route[: len(route)] = route
    core.begin(trips.core, 0, node, edge, start or 0.0, motion, now, speed, left)
    goes_on = core.go(roads, trips.core, 0, motion, len(route))
    core.stand(trips.core, 0)
    (count,), (passed,) = trips.legs, trips.passed
    legs = [column[0, :count].tolist() for column in (trips.edges, trips.begins, trips.ends, trips.since, trips.until)]
    time, ended = now, []
    for row, begin, end, since, until in zip(*legs, strict=True):
        assert since == time <= until <= 1.0
        takes = turns_of(abs(end - begin) * edges[row][2], speed, seconds and abs(end - begin) * seconds)
        if begin != end and speed == speed and not (speed == inf and seconds is None):
            assert takes == pytest.approx(until - since, rel=1e-6, abs=2 * SLACK)
        if begin != end and end in (0.0, 1.0):
            ended.append((edges[row][1] if end else edges[row][0], until))
        time = until
    nodes, times = trips.nodes[0, :passed].tolist(), trips.times[0, :passed].tolist()
    others = [one for before, one in pairwise([(first, now), *ended]) if one[0] != before[0]]
    assert list(zip(nodes, times, strict=True)) == [(first, now), *others], "who comes back to its node stays there"
    assert trips.node[0] == nodes[-1]
    assert time <= 1.0
    if trips.edge[0] >= 0:
        assert time == 1.0
        assert 0.0 < trips.share[0] < 1.0
    if goes_on:
        assert trips.edge[0] < 0
        steps = [ended[0][0], *route] if edge >= 0 else [first, *route]
        assert len(ended) == (edge >= 0) + sum(one != other for one, other in pairwise(steps))
    assert len(ended) <= left


def test_a_route_without_an_edge_is_noticed_and_a_node_twice_in_a_row_is_no_pause():
    roads, trips = map_on([(0, 1, 3.0), (1, 2, 3.0)]), TurnPaths(1, 64)
    trips.route[:5] = [0, 1, 1, 2, 0]
    assert core.without_edge(roads, trips.core, 0, 5) == 4
    assert core.without_edge(roads, trips.core, 0, 4) == -1
    core.begin(trips.core, 0, 0, -1, 0.0, 0, 0.0, 3.0, ENDLESS)
    assert core.go(roads, trips.core, 0, Motion.FORWARD, 4)
    assert trips.times[0, : trips.passed[0]].tolist() == [0.0, 0.5, 1.0]

"""Paths of agents by metres: those that agents remember are those of the graph."""

from math import inf

import pytest
from hypothesis import given
from hypothesis import strategies as st

import gamms
from gamms.core import travel as core
from gamms.game.movement import travel
from gamms.game.movement.travel import RoadMap
from gamms.graph import Graph

IDS = [5, 3, 8, 1, 9, 2]
COSTS = st.sampled_from([0.0, 3.0, 7.0, 10.0, 1.0 / 3.0, inf])
EDGES = st.lists(st.tuples(st.sampled_from(IDS), st.sampled_from(IDS), COSTS), min_size=1, max_size=18)


def roads_of(edges):
    graph = Graph()
    graph.add_nodes(IDS, [0.0] * len(IDS), [0.0] * len(IDS))
    for id, (source, target, cost) in enumerate(edges):
        graph.add_edge({"id": id, "source": source, "target": target, "length": 1.0, "cost": cost})
    return graph, RoadMap(graph, graph.columns(), graph.weights("cost"), None, 2.0)


@given(
    edges=EDGES,
    pairs=st.lists(st.tuples(st.integers(0, 3), st.sampled_from(IDS), st.sampled_from(IDS)), min_size=1, max_size=12),
    most=st.sampled_from([2, 3, 64]),
)
def test_paths_and_distances_are_those_of_the_graph_whatever_agents_remember(edges, pairs, most):
    graph, roads = roads_of(edges)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(travel, "_REMEMBERED", most)
        for agent, source, target in pairs:
            far = graph.distance(source, target, "cost")
            ways, start, goal = roads.get_ways(agent), roads.find_row(source), roads.find_row(target)
            assert core.compute_distance(ways, agent, start, goal) == far
            way = [start]
            while (node := core.find_next_node(ways, agent, way[-1], goal)) != way[-1]:
                way.append(node)
            path = graph.shortest_path(source, target, "cost") if far < inf else [source]
            assert [IDS[node] for node in way] == path


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


@pytest.mark.parametrize("decide", ["turn", "arrival"])
@pytest.mark.parametrize("change", ["close", "remove"])
def test_an_agent_is_counted_as_blocked_once_when_the_road_under_it_is_closed(decide, change):
    def close(ctx):
        if ctx.game.turn == 2:
            ctx.graph.close_roads([0, 1]) if change == "close" else ctx.graph.graph.remove_edge(0)

    with gamms.create_context(seed=1, game={"speed_unit": "metres", "decide": decide, "max_turns": 5}) as ctx:
        ctx.graph.add_nodes([0, 1], [0.0, 100.0], [0.0, 0.0])
        ctx.graph.add_edges([0, 1], [0, 1], [1, 0], [100.0, 100.0])
        ctx.agent.create_agent("car", start_node_id=0, speed=9.0, strategy=lambda state: state.update(action=1))
        ctx.game.on_illegal = "stay"
        ctx.game.add(close)
        with ctx.game.batch(2, seed=1) as games:
            games.run()
            counted = [games.result(i).agents["car"]["blocked"] for i in range(2)]
        result = ctx.game.run()
    stopped = result.agents["car"]["illegal"]
    assert [result.agents["car"]["blocked"], *counted] == [1] * 3
    assert stopped > 0

"""Distances between agents while roads are closed, opened and removed."""

import random

import pytest

import gamms
from gamms.rules import contacts, tag
from gamms.strategies import random_walk


def town():
    """A grid with a second road beside each third one, and five agents of either team."""
    ctx = gamms.create_context(seed=4, logger_config={"level": "CRITICAL"})
    ctx.graph.attach_networkx_graph(gamms.graph.grid(5, 5))
    graph = ctx.graph.graph
    for number, id in enumerate(list(graph.get_edges())[::3]):
        edge = graph.get_edge(id)
        graph.add_edge({"id": 1000 + number, "source": edge.source, "target": edge.target, "length": 7.0})
    ctx.graph.close_roads([0, 1003])
    for number in range(10):
        team = ("red", "blue")[number % 2]
        ctx.agent.create_agent(f"a{number}", start_node_id=number * 7 % 25, team=team, strategy=random_walk)
    return ctx


def change_roads(ctx):
    """Close, open and remove roads, by the turn."""
    lot = random.Random(ctx.game.turn)
    ids = list(ctx.graph.graph.get_edges())
    ctx.graph.close_roads(lot.sample(ids, 6))
    closed = ctx.graph.closed_roads
    ctx.graph.open_roads(lot.sample(closed, min(5, len(closed))))
    if ctx.game.turn % 4 == 0:
        ctx.graph.graph.remove_edge(lot.choice(list(ctx.graph.graph.get_edges())))


def change_more(ctx):
    """Change a node, but for the same values: what is known of the map has to be found out again."""
    node = ctx.graph.graph.get_node(3)
    ctx.graph.graph.update_node({"id": 3, "x": node.x, "y": node.y})


@pytest.mark.parametrize("distance", [{"hops": 2}, {"metres": 17.5}, {"metres": float("inf")}, {"euclid": 11.0}, {}])
@pytest.mark.parametrize("speed", [None, 14.0])
def test_contacts_follow_each_road_that_is_closed_opened_or_removed(distance, speed):
    found = []
    for changes in ([change_roads], [change_roads, change_more]):
        with town() as ctx:
            if speed is not None:
                ctx.game.speed_unit = "metres"
                for agent in ctx.agent.create_iter():
                    agent.speed = speed
            met = []

            def note(ctx, met=met):
                met.append([*contacts(ctx, "red", "blue", **distance)])

            for rule in (note, tag("red", "blue", **distance), *changes):
                ctx.game.add(rule, name=getattr(rule, "__name__", "tag"))
            ctx.game.run(40)
            found.append((met, ctx.game.events, [agent.current_node_id for agent in ctx.game.agents]))
    assert found[0] == found[1]
    assert any(found[0][0])


@pytest.mark.parametrize("unit", ["edges", "metres"])
def test_an_agent_whose_road_closes_before_it_moves_stays_and_the_others_go(unit):
    closed = []
    wanted = {}
    told = {}

    def choose(state):
        wanted[state["name"]] = state["curr_pos"], state["legal"][state["draw"].below(len(state["legal"]))]
        told[state["name"]] = state["blocked"]
        state["action"] = wanted[state["name"]][1]

    def close(ctx):
        """Close half of all roads, and open the others."""
        ctx.graph.open_roads(ctx.graph.closed_roads)
        chosen = ctx.stream("close", ctx.game.turn).permutation(sorted(edges.values()))
        closed[:] = chosen[::2].tolist()
        ctx.graph.close_roads(closed)

    stopped = 0
    with gamms.create_context(seed=2, logger_config={"level": "CRITICAL"}) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(4, 4, spacing=10.0))
        graph = ctx.graph.graph
        edges = {(graph.get_edge(id).source, graph.get_edge(id).target): id for id in graph.get_edges()}
        ctx.game.speed_unit = unit
        agents = [ctx.agent.create_agent(f"a{i}", start_node_id=i, team="red", strategy=choose) for i in range(8)]
        for agent in agents:
            agent.speed = 1.0 if unit == "edges" else 10.0
        ctx.game.add(close, phase="deeds")
        for _ in range(12):
            ctx.game.step()
            ways = [wanted[agent.name] for agent in agents]
            are_open = [start == end or edges[start, end] not in closed for start, end in ways]
            ends = [way[is_open] for way, is_open in zip(ways, are_open, strict=True)]
            assert [agent.current_node_id for agent in agents] == ends
            stopped += are_open.count(False)
        assert stopped > 10
        ctx.game.step()
        assert {*told.values()} == {None, "its way was closed"}

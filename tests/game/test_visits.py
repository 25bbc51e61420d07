"""When agents come to nodes and edges: `ctx.game.visits`, and the rule `idleness`."""

import math

import networkx as nx
import numpy as np
import pytest

import gamms
from gamms.errors import BadType, BadValue, UnknownName
from gamms.rules import idleness, idleness_table
from gamms.typing.game import Visit

NODES = 12
SIDE = 200 * math.sin(math.pi / NODES)  # of a regular polygon in a circle of 100


def circle():
    """Return a street along a circle, with an edge in each direction: 2 * i leads from node i to the next."""
    graph = nx.DiGraph()
    for node in range(NODES):
        angle = 2 * math.pi * node / NODES
        graph.add_node(node, x=100 * math.cos(angle), y=100 * math.sin(angle))
    for node in range(NODES):
        graph.add_edge(node, (node + 1) % NODES, id=2 * node)
        graph.add_edge((node + 1) % NODES, node, id=2 * node + 1)
    return graph


def go_round(state):
    """Go to the farthest of the next nodes that is legal."""
    ahead = [(state["curr_pos"] + steps) % NODES for steps in range(1, NODES - 1)]
    if "edge" not in state:
        state["action"] = ahead[0]
    else:
        state["action"] = ahead[:3]


def patrol(starts, speed=None, strategy=go_round, **settings):
    """Return a game of agents on the circle."""
    ctx = gamms.create_context(seed=1, game=settings, logger_config={"level": "WARNING"})
    ctx.graph.attach_networkx_graph(circle())
    for number, node in enumerate(starts):
        ctx.agent.create_agent(f"a{number}", start_node_id=node, team="blue", speed=speed, strategy=strategy)
    return ctx


def stay(state):
    state["action"] = state["curr_pos"]


def test_an_agent_that_counts_edges_visits_the_ends_of_its_steps():
    with patrol([0], strategy=lambda state: state.update(action=[1, 2, 3]), speed=3) as ctx:
        ctx.game.step()
        third = 1 / 3
        assert ctx.game.visits() == [
            Visit("a0", "blue", 1, None, third, third),
            Visit("a0", "blue", 2, None, 2 * third, 2 * third),
            Visit("a0", "blue", 3, None, 1.0, 1.0),
        ]
        edges = [visit.edge for visit in ctx.game.visits(edges=ctx.graph.graph.get_edges())]
        ends = [(ctx.graph.graph.get_edge(id).source, ctx.graph.graph.get_edge(id).target) for id in edges]
        assert ends == [(0, 1), (1, 2), (2, 3)]


def test_an_agent_that_waits_visits_its_node_for_the_whole_turn_once():
    for settings, speed in (({}, None), ({"speed_unit": "metres"}, 30.0)):
        with patrol([4], speed, stay, **settings) as ctx:
            for turn in (1, 2):
                ctx.game.step()
                assert ctx.game.visits() == [Visit("a0", "blue", 4, None, turn - 1.0, float(turn))]


def test_an_agent_in_the_middle_of_an_edge_visits_no_node():
    with patrol([0], 0.4 * SIDE, speed_unit="metres") as ctx:
        found = []
        for _ in range(3):
            ctx.game.step()
            found.append(ctx.game.visits())
        assert found[:2] == [[], []]
        [visit] = found[2]
        assert (visit.node, visit.time) == (1, pytest.approx(2.5, abs=1e-12))
        on_edges = ctx.game.visits(edges=ctx.graph.graph.get_edges())
        assert [one.time for one in on_edges] == pytest.approx([2.0, 2.5])
        assert [one.until for one in on_edges] == pytest.approx([2.5, 3.0])
        both = ctx.game.visits(nodes=1, edges=on_edges[1].edge)
        assert [(one.node, one.edge) for one in both] == [(1, None), (None, on_edges[1].edge)]
        assert ctx.game.visits(nodes=[5]) == []


def test_an_agent_that_a_rule_has_placed_visits_its_node_at_the_end_of_the_turn():
    with patrol([0]) as ctx:
        ctx.game.add(lambda ctx: ctx.game.respawn("a0", 7), name="put")
        ctx.game.step()
        assert ctx.game.visits() == [Visit("a0", "blue", 7, None, 1.0, 1.0)]


def test_impossible_places_are_refused():
    with patrol([0]) as ctx:
        ctx.game.step()
        for given, error, words in (
            ({"nodes": "a"}, BadType, "Each of nodes must be an integer, not 'a'"),
            ({"nodes": [99]}, UnknownName, "Unknown node 99"),
            ({"edges": 1.5}, BadType, "Each of edges must be an integer, not 1.5"),
        ):
            with pytest.raises(error, match=words):
                ctx.game.visits(**given)
        with pytest.raises(UnknownName, match="Unknown rule idleness with the key 'idleness'"):
            idleness_table(ctx)
        with pytest.raises(UnknownName, match="node 99"):
            ctx.game.add(idleness([1, 99]))
        with pytest.raises(BadValue, match="A node to patrol is missing"):
            idleness([])


@pytest.mark.parametrize("fleet", [1, 2, 3, 4])
@pytest.mark.parametrize("speed", [None, 0.7 * SIDE, 1.3 * SIDE])
def test_a_cyclic_patrol_has_the_idleness_of_the_closed_form(fleet, speed):
    settings = {} if speed is None else {"speed_unit": "metres"}
    with patrol([number * NODES // fleet for number in range(fleet)], speed, **settings) as ctx:
        ctx.game.add(idleness(teams="blue"))
        ctx.game.run(max_turns=70)
        table = idleness_table(ctx)
        expected = NODES * SIDE / (fleet * (speed or SIDE))
        np.testing.assert_allclose(table["average"], expected, rtol=0, atol=1e-9)
        np.testing.assert_allclose(table["worst"], expected, rtol=0, atol=1e-9)
        assert table["node"].tolist() == list(range(NODES))


def test_nodes_that_no_agent_of_the_team_visits_are_idle_from_the_start():
    with patrol([0, 6], strategy=stay) as ctx:
        ctx.agent.create_agent("red", start_node_id=3, team="red", strategy=stay)
        ctx.game.add(idleness([0, 3, 6], teams="blue"))
        ctx.game.run(max_turns=5)
        table = idleness_table(ctx)
        assert table["visits"].tolist() == [1, 0, 1]
        assert table["worst"].tolist() == [0.0, 5.0, 0.0]
        assert np.isnan(table["average"]).all()


def test_an_agent_on_an_edge_has_not_visited_the_node_that_it_left_when_the_rule_was_added():
    with patrol([0], 0.4 * SIDE, speed_unit="metres") as ctx:
        ctx.game.step()
        ctx.game.add(idleness())
        ctx.game.step()
        assert idleness_table(ctx)["visits"].tolist() == [0] * NODES


def test_an_agent_that_comes_between_two_turns_visits_the_node_where_it_begins():
    with patrol([0], strategy=stay) as ctx:
        ctx.game.add(idleness([5]))
        ctx.game.step()
        ctx.agent.create_agent("late", start_node_id=5, team="blue", strategy=go_round)
        ctx.game.step()
        assert idleness_table(ctx)["visits"].tolist() == [1]
        assert idleness_table(ctx)["worst"].tolist() == [1.0]


def collected_in(ctx):
    ctx.game.collect("visits", lambda ctx: [tuple(one) for one in ctx.game.visits(edges=range(2 * NODES))])
    ctx.game.collect("worst", lambda ctx: float(idleness_table(ctx)["worst"].max()), every=3)


def wander(state):
    state["action"] = state["draw"].choice(state["legal"])


@pytest.mark.parametrize("speed", [None, 0.7 * SIDE])
def test_visits_in_a_batch_are_those_of_each_game_alone(speed):
    settings = {} if speed is None else {"speed_unit": "metres"}
    with patrol([0, 5, 9], speed, wander, **settings) as ctx:
        ctx.game.add(idleness())
        collected_in(ctx)
        with ctx.game.batch(seeds=range(4)) as games:
            games.run(max_turns=12)
            for number in range(4):
                ctx.game.reset(seed=number)
                assert ctx.game.run(max_turns=12).collected == games.result(number).collected

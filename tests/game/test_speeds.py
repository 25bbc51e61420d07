"""Agents on the ground that go more than one edge in a turn, or less."""

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import gamms
from gamms.errors import NoPath
from gamms.strategies import goto

LAWS = settings(max_examples=15)
SPEEDS = ["0", "0.1", "0.3", "0.5", "1", "1.1", "1.5", "2.75", "3"]


def places(agent, result):
    return [agent.seen[i]["curr_pos"] for i in range(len(agent.seen))] + [result.agents[agent.name]["node"]]


def test_a_list_or_an_array_is_walked_along_as_far_as_the_speed_goes(ctx, play):
    agent = play("a", 0, [4, 5, 1, 0], [4, 6], np.array([4, 8]), speed=2)
    result = ctx.game.run(3)
    assert places(agent, result) == [0, 5, 5, 8]
    assert result.errors[0]["message"] == "BadValue: No edge leads from node 4 to node 6."


def test_a_list_may_begin_with_the_own_node_and_be_empty(ctx, play):
    agent = play("a", 0, [0, 1, 2], [], [2], speed=5)
    assert places(agent, ctx.game.run(3)) == [0, 2, 2, 2]


def test_a_speed_of_zero_stays_and_an_endless_one_goes_anywhere(ctx, play):
    slow, fast = play("a", 0, 1, speed=0), play("b", 0, 15, speed=float("inf"))
    ctx.game.speed_unit = "metres"
    ctx.game.step()
    assert (slow.current_node_id, fast.current_node_id) == (0, 15)


def test_a_speed_may_change_while_the_game_runs(ctx, play):
    agent = play("a", 0, 3, 3, speed=1)
    ctx.game.step()
    agent.speed = 2
    ctx.game.step()
    assert agent.current_node_id == 3


def test_a_node_that_no_way_leads_to_is_not_legal(ctx, play):
    ctx.graph.graph.add_node({"id": 99, "x": 0, "y": 0})
    play("a", 0, 99, speed=2)
    message = ctx.game.run(1).errors[0]["message"]
    assert message == f"BadValue: {NoPath(0, 99)}"


@pytest.mark.parametrize("speed", [-1, float("nan"), "fast"])
def test_an_impossible_speed_is_named_when_it_is_set(ctx, play, speed):
    with pytest.raises((ValueError, TypeError), match="speed of agent 'a'"):
        play("a", 0, 1, speed=speed)
    agent = play("a", 0, 1, speed=2)
    with pytest.raises((ValueError, TypeError), match="speed of agent 'a'"):
        agent.speed = speed
    assert agent.speed == 2


# -- parts of edges ---------------------------------------------------------------------------------------------


def walk_along(lengths, speed, unit, turns, target=None):
    """The positions, turn by turn, of an agent that goes along a road with edges of these lengths."""
    with gamms.create_context(seed=1, logger_config={"level": "CRITICAL"}, game={"speed_unit": unit}) as ctx:
        nodes = range(len(lengths) + 1)
        ctx.graph.add_nodes(nodes, nodes, [0] * len(nodes))
        ctx.graph.add_edges(range(len(lengths)), nodes[:-1], nodes[1:], lengths)
        agent = ctx.agent.create_agent("a", start_node_id=0, speed=float(speed), strategy=goto(ctx, nodes[-1]))
        found = []
        for _ in range(turns):
            ctx.game.step()
            found.append(agent.current_node_id)
        return found


@LAWS
@given(
    lengths=st.lists(st.sampled_from([0.25, 1.0, 2.5, 7.0, 40.0]), min_size=1, max_size=12),
    speed=st.sampled_from(SPEEDS),
    unit=st.sampled_from(["edges", "metres"]),
)
def test_on_the_way_to_one_node_nothing_is_lost_or_gained(lengths, speed, unit):
    costs = [Fraction(1) if unit == "edges" else Fraction(length) for length in lengths]
    ends = [sum(costs[:i]) for i in range(len(costs) + 1)]
    for turn, node in enumerate(walk_along(lengths, speed, unit, 20), 1):
        assert node == max(i for i, end in enumerate(ends) if end <= turn * Fraction(speed))


def edge_of(ctx, source, target):
    """The id of the edge between two nodes."""
    edges = map(ctx.graph.graph.get_edge, ctx.graph.graph.get_edges())
    return next(edge.id for edge in edges if (edge.source, edge.target) == (source, target))


def test_an_edge_that_is_made_longer_takes_longer(ctx, play):
    ctx.game.speed_unit = "metres"
    agent = play("a", 0, [1], [2], speed=10.0)
    ctx.game.run(1)
    ctx.graph.graph.update_edge({"id": edge_of(ctx, 1, 2), "source": 1, "target": 2, "length": 20.0})
    assert places(agent, ctx.game.run(1)) == [0, 1, 1]

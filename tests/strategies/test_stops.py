"""Agents with a speed that go along a list of stops: they stop at none of them before the turn is over."""

from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

import gamms
from gamms.rules import Conflicts
from gamms.sensor import SensorType
from gamms.strategies import first, follow_path, patrol, stay, unblock

NODES = st.integers(0, 24)
SPEEDS = st.integers(1, 30).map(lambda quarters: quarters / 4)  # edges in a turn


def played(strategy, start, speed, turns, unit="edges", **settings):
    """Play an agent alone on a grid; return its context's game, its nodes after each turn, and all that it passed."""
    ctx = gamms.create_context(seed=1, game={"speed_unit": unit, "on_illegal": "raise", **settings})
    ctx.graph.attach_networkx_graph(gamms.graph.grid(5, 5))
    length = 1.0 if unit == "edges" else ctx.graph.graph.get_edge(0).length
    ctx.agent.create_agent("anna", start_node_id=start, speed=speed * length, strategy=strategy(ctx))
    nodes, passed = [start], [start]
    for _ in range(turns):
        ctx.game.step()
        move = ctx.game.moves["anna"]
        nodes.append(move.end)
        passed += move.path[1:]
    ctx.terminate()
    return nodes, passed


def walk_through(stops, start):
    """All nodes on the way from a node through these stops."""
    with gamms.create_context() as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(5, 5))
        legs = [ctx.graph.graph.shortest_path(*leg)[1:] for leg in pairwise([start, *stops])]
        return [start, *(node for leg in legs for node in leg)]


@pytest.mark.parametrize("unit", ["edges", "metres"])
@given(stops=st.lists(NODES, min_size=1, max_size=5), start=NODES, speed=SPEEDS)
def test_a_path_is_followed_at_full_speed_to_its_end(unit, stops, start, speed):
    walk = walk_through(stops, start)
    turns = int(len(walk) / speed) + 2
    nodes, passed = played(lambda ctx: follow_path(ctx, stops), start, speed, turns, unit)
    assert nodes == [walk[min(int(turn * speed), len(walk) - 1)] for turn in range(turns + 1)]
    assert passed == walk


@pytest.mark.parametrize("unit", ["edges", "metres"])
@given(stops=st.lists(NODES, min_size=2, max_size=4, unique=True), first_stop=st.integers(0, 3), speed=SPEEDS)
def test_a_patrol_loses_no_part_of_a_turn_however_many_rounds_it_makes_in_one(unit, stops, first_stop, speed):
    at = first_stop % len(stops)
    walk = walk_through([*stops[at + 1 :], *(stops * 40)], stops[at])
    nodes, passed = played(lambda ctx: patrol(ctx, stops), stops[at], speed, 9, unit)
    assert nodes == [walk[int(turn * speed)] for turn in range(10)]
    assert passed == walk[: len(passed)]


@given(stops=st.lists(NODES, min_size=2, max_size=3, unique=True), start=NODES, speed=SPEEDS)
def test_by_metres_it_makes_no_difference_whether_agents_are_asked_at_each_node(stops, start, speed):
    games = [
        played(lambda ctx: patrol(ctx, stops), start, speed, 12, "metres", decide=decide)
        for decide in ("turn", "arrival")
    ]
    assert games[0] == games[1]


def test_an_agent_that_was_stopped_leaves_out_no_stop():
    with gamms.create_context(seed=1, game={"conflicts": Conflicts(capacity=1)}) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(1, 6))
        beat = patrol(ctx, [0, 2, 4])
        anna = ctx.agent.create_agent("anna", start_node_id=0, speed=4, strategy=beat)
        ctx.agent.create_agent("bert", start_node_id=4)
        ctx.game.step()
        assert anna.current_node_id == 0
        assert anna.state["blocked"] is None
        ctx.agent.delete_agent("bert")
        ctx.game.step()
        assert ctx.game.moves["anna"].path == (0, 1, 2, 3, 4)
        assert anna.state["blocked"] is not None
        assert anna.state["memory"]["patrol [0, 2, 4]"] == 1


def test_a_patrol_goes_on_where_another_strategy_has_led_the_agent():
    def away(state):
        if state["turn"] == 1:
            state["action"] = 7

    nodes, _ = played(lambda ctx: first(away, patrol(ctx, [0, 4])), 0, 3.0, 5)
    assert nodes == [0, 3, 7, 4, 1, 2]


def test_a_patrol_at_any_speed_ends_its_turn():
    for speed in (1e12, float("inf")):
        nodes, passed = played(lambda ctx: patrol(ctx, [0, 4]), 0, speed, 2)
        assert set(nodes) <= {0, 1, 2, 3, 4}
        assert len(passed) < 30_000


def test_unblock_reads_a_way_beyond_a_stop():
    nodes, _ = played(lambda ctx: unblock(follow_path(ctx, [1, 2, 3], otherwise=stay)), 0, 2.0, 3)
    assert nodes == [0, 2, 3, 3]


def test_a_chaser_on_a_one_way_road_goes_round_to_an_enemy_behind_it():
    with gamms.create_context(seed=1, game={"speed_unit": "metres", "on_illegal": "raise"}) as ctx:
        ctx.graph.add_nodes([0, 1, 2], [0.0, 100.0, 50.0], [0.0, 0.0, 50.0])
        ctx.graph.add_edges([0, 1, 2], [0, 1, 2], [1, 2, 0], [100.0, 80.0, 80.0])
        ctx.sensor.create_sensor("eyes", SensorType.AGENT)
        drive = lambda state: state.update(action=1)
        cat = ctx.agent.create_agent("cat", start_node_id=0, team="red", speed=60.0, sensors=["eyes"], strategy=drive)
        ctx.agent.create_agent("mouse", start_node_id=0, team="blue", speed=20.0, strategy=drive)
        ctx.game.step()
        cat.register_strategy(gamms.strategies.chase(ctx))
        ctx.agent.get_agent("mouse").register_strategy(lambda state: state.update(action=None))
        places = []
        for _ in range(3):
            ctx.game.step()
            places.append((cat.edge, cat.offset_m))
        assert places == [((1, 2, 1), pytest.approx(20.0)), (None, 0.0), ((2, 0, 2), 60.0)]

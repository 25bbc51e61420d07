"""Meeting on the way: when and where agents meet within a turn, by hand and against a tiny simulator."""

from math import inf

import pytest

import gamms
from gamms.agent import AgentType
from gamms.rules import capture_flag, contacts, tag
from gamms.strategies import goto


def open_road(*agents, nodes=10, unit="edges"):
    """A game on a road of nodes ten metres apart: agents `(name, team, start, speed, target)`."""
    ctx = gamms.create_context(seed=5, logger_config={"level": "CRITICAL"}, game={"speed_unit": unit})
    ctx.graph.attach_networkx_graph(gamms.graph.grid(1, nodes))
    for name, team, start, speed, target in agents:
        ctx.agent.create_agent(name, start_node_id=start, team=team, speed=speed, strategy=goto(ctx, target))
    return ctx


def met(ctx, a="red", b="blue", **more):
    """Who meets whom after one more turn: name, name, time, where the one was and where the other."""
    ctx.game.step()
    return [(one.a, one.b, one.time, one.a_node, one.b_node) for one in contacts(ctx, a, b, **more)]


# -- by hand ----------------------------------------------------------------------------------------------------


def test_draws_decide_who_is_met_of_those_that_are_met_at_once():
    firsts = set()
    for seed in range(20):
        ctx = open_road(("r", "red", 0, 2, 2), ("b", "blue", 1, None, 1), ("c", "blue", 1, None, 1))
        ctx.reseed(seed)
        firsts.add(met(ctx)[0][1])
    assert firsts == {"b", "c"}


def test_who_was_put_elsewhere_is_there_at_the_end_of_the_turn():
    ctx = open_road(("r", "red", 0, 4, 4), ("b", "blue", 2, None, 2), ("c", "blue", 0, None, 0))
    ctx.game.step()
    ctx.game.respawn("r")
    assert [(one.b, one.time) for one in contacts(ctx, "red", "blue")] == [("c", 1.0)]


@pytest.mark.parametrize(("unit", "speed"), [("edges", 4), ("metres", 40.0)])
@pytest.mark.parametrize("place", ["respawn", "node", "snapshot"])
def test_an_agent_that_is_put_where_its_own_path_ends_has_not_come_there_by_it(unit, speed, place):
    ctx = open_road(("r", "red", 0, speed, 4), ("b", "blue", 2, None, 2), ("c", "blue", 0, None, 0), unit=unit)
    ctx.agent.get_agent("r").strategy = lambda state: state.update(action=[0, 1, 2, 1, 0])
    ctx.game.step()
    assert [one.time for one in contacts(ctx, "red", "blue")] == [0.5, 1.0]
    if place == "node":
        ctx.agent.get_agent("r").current_node_id = 0
    else:
        ctx.game.respawn("r")
    if place == "snapshot":
        here = ctx.game.snapshot()
        ctx.game.step()
        ctx.game.restore(here)
    assert [(one.b, one.time) for one in contacts(ctx, "red", "blue")] == [("c", 1.0)]
    assert [(one.b, one.time) for one in contacts(ctx.game.fork(5).ctx, "red", "blue")] == [("c", 1.0)]
    assert [one[2] for one in met(ctx)] == [0.5, 1.0]  # until it moves again


def test_a_flyer_that_is_put_where_it_flew_to_has_not_gone_along_an_edge():
    ctx = open_road(("r", "red", 1, None, 0))
    ctx.agent.create_agent("b", type=AgentType.AERIAL, team="blue", start_node_id=0, speed=10.0)
    ctx.agent.get_agent("b").strategy = lambda state: state.update(action=(10.0, 0.0, 0.0))
    ctx.game.step()
    ctx.agent.get_agent("b").position = ctx.agent.get_agent("b").position
    assert contacts(ctx, "red", "blue", air=True) == []


@pytest.mark.parametrize("unit", ["edges", "metres"])
def test_a_runner_that_is_tagged_on_its_way_home_captures_no_flag_in_that_turn(unit):
    ctx = open_road(
        ("runner", "red", 0, {"edges": 4, "metres": 40.0}[unit], 9), ("guard", "blue", 1, None, 1), unit=unit
    )
    ctx.agent.get_agent("runner").strategy = lambda state: state.update(action=[0, 1, 2, 1, 0])
    ctx.game.add(tag("blue", "red"))
    ctx.game.add(capture_flag({"blue": 2, "red": 0}))
    assert [event["kind"] for event in ctx.game.run(1).events] == ["tag", "respawned"]


@pytest.mark.parametrize("mover", ["red", "blue"])
def test_an_agent_that_a_deed_puts_where_its_part_of_the_turn_ended_has_met_no_agent_on_its_way(mover):
    ctx = open_road(("r", "red", 0, 4, 9), ("b", "blue", 2, None, 2))
    ctx.agent.get_agent("r").strategy = lambda state: state.update(action=[0, 1, 2, 1, 0])
    ctx.game.order = [["red"], ["blue"]]
    parts = iter(["red", "blue"])

    def put(ctx):
        if next(parts) == mover:
            ctx.game.respawn("r")

    ctx.game.add(put, phase="deeds")
    ctx.game.step()
    assert bool(contacts(ctx, "red", "blue")) is (mover == "red")  # before it moves it is put where it begins


def test_with_a_distance_agents_are_compared_when_one_reaches_a_node():
    ctx = open_road(("r", "red", 0, 4, 8), ("b", "blue", 5, None, 6))
    assert met(ctx, hops=2) == [("r", "b", 0.75, 3, 5)]  # the other counts as on 5 until it is on 6
    ctx = open_road(("r", "red", 0, 2, 2), ("b", "blue", 3, None, 3), ("near", "blue", 1, None, 2))
    assert met(ctx, euclid=10.0) == [("r", "near", 0.5, 1, 1), ("r", "b", 1.0, 2, 3)]
    ctx = open_road(("r", "red", 5, None, 5), ("b", "blue", 3, None, 3), ("c", "blue", 2, None, 4))
    assert [one[:3] for one in met(ctx, metres=20)] == [("r", "b", 0.0), ("r", "c", 1.0)]  # earlier, if farther away


def test_an_endless_speed_takes_the_whole_turn():
    for unit in ("edges", "metres"):
        assert met(open_road(("r", "red", 0, inf, 4), ("b", "blue", 1, None, 1), unit=unit)) == [("r", "b", 0.25, 1, 1)]

"""Rules in batches: each game is the one that is played alone, whatever the rules do in it."""

from pathlib import Path

import networkx as nx
import pytest
from batch_scenes import check_games, plain, scene

import gamms
from gamms.errors import MissingKey, UnknownName
from gamms.game.plan import find_first_called
from gamms.rules import Conflicts, by_priority, discover, last_team
from gamms.scenario import Scenario

SEEDS = [1, 2**40]


def rule(name, /, **arguments):
    return {"rule": name, "with": arguments}


def winding():
    """A street that is longer than a straight line, and a shorter one beside it that leads one way only."""
    graph = nx.MultiDiGraph()
    graph.add_nodes_from((node, {"x": 10.0 * node, "y": 0.0}) for node in range(3))
    for source, target, length in ((0, 1, 25.0), (0, 1, 15.0), (1, 0, 25.0), (1, 2, 30.0), (2, 1, 30.0)):
        graph.add_edge(source, target, length=length)
    return graph


def test_a_way_costs_as_much_as_the_shortest_edge_along_it(same_as_one_by_one):
    fuel = rule("resource", name="fuel", start=100, per_metre=1)
    map = {"generator": {"function": "test_rules_in_arrays:winding"}}
    same_as_one_by_one(scene([fuel], map=map, folder=Path(__file__).parent, max_turns=6), SEEDS)


def test_teams_without_agents_discover_nothing():
    with scene().build(seed=1) as ctx:
        ctx.agent.create_team("green", [])
        ctx.game.add(discover([3], teams=["green"]))
        with ctx.game.batch(2) as games:
            games.run()
            assert [games.result(number).events for number in range(2)] == [[], []]


def first_by_name(contest, ctx):
    return [contest.movers[0]]


def crowded(capacity, resolve=None):
    ctx = scene([], red=6, blue=6, side=4, max_turns=8).build(seed=1)
    for node in range(16):
        ctx.graph.graph.update_node({"id": node, "room": node % 3})
    ctx.game.conflicts = Conflicts(capacity, resolve=resolve)
    return ctx


def test_capacities_may_be_attributes_of_nodes():
    with crowded("room") as ctx:
        check_games(ctx, seeds=[3])
    with crowded("rooms") as ctx, pytest.raises(UnknownName, match="rooms"):
        ctx.game.batch(1)


def test_a_resolver_that_is_a_function_is_asked_game_by_game():
    with crowded(1, first_by_name) as ctx, ctx.game.batch(1) as games:
        assert "Conflicts" in find_first_called(games.game, games.roster)


def test_a_team_that_is_not_in_the_list_is_named():
    with crowded(1, by_priority(["red"])) as ctx, ctx.game.batch(4) as games, pytest.raises(MissingKey, match="blue"):
        games.run()


def test_a_game_of_agents_of_no_team_is_over_for_the_last_team():
    with gamms.create_context(logger_config={"level": "CRITICAL"}) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(3, 3))
        ctx.agent.create_agent("one", start_node_id=0, strategy=gamms.strategies.random_walk)
        ctx.game.add(last_team())
        with ctx.game.batch(2) as games:
            games.run()
            assert games.table()["reason"].tolist() == ["last team"] * 2


@pytest.mark.parametrize("more", [[rule("time_limit", turns=2)], []])
def test_a_batch_of_a_game_without_further_turns_is_over_at_once(more):
    with scene(more, side=4, max_turns=2).build(seed=1) as ctx:
        over = ctx.game.run()
        with ctx.game.batch(2) as games:
            assert games.is_in_arrays
            assert games.is_over.tolist() == [True, True]
            games.step()
            games.reset([1], seeds=[5])
            games.run()
            for number in range(2):
                assert plain(games.result(number)) | {"seed": 1} == plain(over)
                assert games.context(number).game.turn == 2


def test_a_score_is_an_integer_where_no_other_number_was_added_in_its_own_game():
    def bonus(ctx):
        ctx.game.scores["red"] += 0.5 if ctx.seed == 1 else 1

    scene = Scenario(map={"grid": {"width": 3, "height": 3}}, teams={"red": {"count": 1}}, max_turns=2)
    with scene.build(seed=1) as ctx:
        ctx.game.add(bonus)
        with ctx.game.batch(seeds=[1, 2]) as games:
            games.step()
            games.step()
            assert [repr(games.result(i).scores["red"]) for i in (0, 1)] == ["1.0", "2"]
            games.reset([0], seeds=[3])
            games.step()
            assert repr(games.result(0).scores["red"]) == "1"


def test_an_agent_that_was_out_has_the_start_again_where_it_pays_before_it_moves(same_as_one_by_one):
    fuel = {"rule": "resource", "with": {"name": "fuel", "start": 4, "per_edge": 1}, "phase": "deeds"}
    out = {"rule": "tag", "with": {"taggers": "red", "tagged": "blue", "then": "eliminate", "hops": 1}}
    same_as_one_by_one(scene([fuel, out, {"rule": "respawn", "with": {"after": 1}}]), range(4))

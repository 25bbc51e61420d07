"""Teams that play one after another: games of a batch are those that are played alone."""

import numpy as np
import pytest
from batch_scenes import assert_as_alone, scene

import gamms
from gamms.errors import BadValue
from gamms.rules import Conflicts
from gamms.strategies import random_walk, stay

SEEDS = [*range(12)]
ORDER = [["blue"], ["red"]]
TAG = {"rule": "tag", "with": {"taggers": "red", "tagged": "blue", "then": "respawn"}}


def check(ctx, seeds):
    """Check that games in the core are those that are played alone; return their results."""
    with ctx.game.batch(seeds=seeds) as games, ctx.game.fork(0).ctx as alone:
        games.run()
        assert games.is_in_arrays
        assert_as_alone(games, alone)
        return [games.result(number) for number in range(len(seeds))]


@gamms.array_rule
def toll(turn):
    """Note when agents are where."""
    visits = turn.visits(turn.alive | turn.took_part)
    when = {"since": visits.begin.tolist(), "until": visits.end.tolist()}
    turn.emit("toll", visits.at, agents={"agent": visits.agents}, nodes={"node": visits.nodes}, values=when)


def test_an_agent_that_comes_back_to_a_team_without_a_part_is_refused_in_its_turn():
    def revive(ctx):
        if ctx.game.turn == 3:
            ctx.game.respawn(ctx.agent.get_agent("blue_0"))

    with scene(blue=1).build() as ctx, ctx.game.fork(0).ctx as other:
        for one in (ctx, other):
            one.game.eliminate(one.agent.get_agent("blue_0"))
            one.game.order = [["red"]]
        assert [result.turns for result in check(ctx, SEEDS[:2])] == [12, 12]
        other.game.add(revive)
        with other.game.batch(2) as games:
            with pytest.raises(BadValue, match="leaves out team 'blue'") as raised:
                games.run()
            assert "In game 0 of a batch, with the seed 0." in raised.value.__notes__
            assert games.turn.tolist() == [3, 3]


def in_the_middle_of_a_turn(steps=3):
    """Return a game that begins where the agents of the second of two teams decide."""
    forks = []

    def ask(state):
        forks.append(state["fork"](7))
        state["action"] = state["draw"].choice(state["legal"])

    with scene([], side=4, settings={"order": ORDER}).build() as ctx:
        ctx.agent.get_agent("red_1").strategy = ask
        for _ in range(steps):
            ctx.game.step()
    game = forks[-1].game
    for agent in game.ctx.agent.create_iter():
        agent.strategy = random_walk
    return game


@pytest.mark.parametrize("strategy", [stay, random_walk])
def test_games_go_on_in_the_middle_of_a_turn(strategy):
    game = in_the_middle_of_a_turn()
    game.conflicts = Conflicts(1)
    before = {agent.name: agent.current_node_id for agent in game.ctx.agent.create_iter()}
    game.ctx.agent.get_agent("red_0").strategy = strategy
    game.max_turns = game.turn + 1
    for result in check(game.ctx, SEEDS):
        assert all(one["node"] == before[name] for name, one in result.agents.items() if one["team"] == "blue")
    game.max_turns = game.turn + 5
    assert {result.turns for result in check(game.ctx, SEEDS)} == {game.turn + 5}


@gamms.array_rule
def meter(turn):
    """Note where agents are about to go, and how."""
    visits = turn.visits(turn.alive | turn.took_part)
    when = {"since": visits.begin.tolist(), "until": visits.end.tolist()}
    turn.emit("meter", visits.at, agents={"agent": visits.agents}, nodes={"node": visits.nodes}, values=when)
    there = turn.is_there_by_move
    turn.emit("there", np.arange(len(turn.games)), values={"agents": [repr(one.tolist()) for one in there]})


MOTIONS = {
    "one edge": ({}, None),
    "edges": ({}, 2.5),
    "metres": ({"speed_unit": "metres"}, 14.0),
    "metres, at arrivals": ({"speed_unit": "metres", "decide": "arrival"}, 23.0),
}
RULES = [TAG, {"rule": "capture_flag", "with": {"flags": {"red": 3, "blue": 12}, "goal": None}}]


@pytest.mark.parametrize("phase", ["deeds", "after"])
@pytest.mark.parametrize("motion", MOTIONS)
def test_array_rules_know_where_teams_that_move_one_after_another_are_about_to_go(motion, phase):
    settings, speed = MOTIONS[motion]
    scenario = scene(RULES, side=4, max_turns=8, settings=settings | {"order": [["blue"], ["red"]]})
    with scenario.build(seed=1) as ctx:
        for number, agent in enumerate(ctx.agent.create_iter()):
            agent.speed = [speed, None, speed and 0.3 * speed][number % 3]
        ctx.game.conflicts = Conflicts(2)
        ctx.game.add(meter, phase=phase)
        ctx.game.add(toll)
        results = check(ctx, SEEDS)
    assert any(event["kind"] == "tag" for result in results for event in result.events)


def test_an_agent_that_a_rule_takes_off_its_edge_after_its_move_leaves_room_there():
    settings = {"max_turns": 1, "speed_unit": "metres", "order": [["red"], ["blue"]]}
    with gamms.create_context(seed=6, logger_config={"level": "CRITICAL"}, game=settings) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(1, 2, spacing=10.0))
        ctx.game.conflicts = Conflicts(None, edge_capacity=1)
        for team in ("red", "blue"):
            there = gamms.strategies.goto(ctx, 1)
            ctx.agent.create_agent(team, start_node_id=0, team=team, speed=3.0, strategy=there)
        ctx.game.add(lambda ctx: ctx.game.respawn("red"), phase="deeds")
        [result] = check(ctx, [6])
        assert [result.agents[name]["blocked"] for name in ("red", "blue")] == [0, 0]


def tell_moves(ctx):
    """Note how agents have moved, or are about to move, and why they did not."""
    moves = {name: [*move.path] for name, move in ctx.game.moves.items()}
    ctx.game.emit("moves", of=moves, counts=str(ctx.game.counts), at=[one.current_node_id for one in ctx.game.agents])


@pytest.mark.parametrize("more", [{}, {"speed_unit": "metres"}, {"speed_unit": "edges"}])
@pytest.mark.parametrize("phase", ["before", "deeds", "after"])
def test_functions_of_games_in_the_middle_of_a_turn_see_it_as_alone(phase, more):
    def walk(state):
        state["memory"].setdefault("blocked", []).append(state["blocked"])
        state["action"] = state["draw"].choice(state["legal"])

    game = in_the_middle_of_a_turn()
    game.configure(more)
    game.conflicts = Conflicts(1)
    game.add(tell_moves, phase=phase)
    for agent in game.ctx.agent.create_iter():
        agent.speed = {"metres": 9.0, "edges": 2.0}.get(more.get("speed_unit"))
        if agent.name != "blue_1":
            agent.strategy = walk
    game.max_turns = game.turn + 4
    check(game.ctx, SEEDS)

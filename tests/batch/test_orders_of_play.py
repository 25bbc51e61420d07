"""Teams that play one after another: games of a batch are those that are played alone."""

import numpy as np
import pytest
from batch_scenes import WALK, assert_as_alone, scene

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
        assert games.is_in_arrays, games.slow
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

    with scene(blue=1, settings={"order": [["red"]]}).build() as ctx, ctx.game.fork(0).ctx as other:
        for one in (ctx, other):
            one.game.eliminate(one.agent.get_agent("blue_0"))
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


DEEDS = {"scan": {}}


def scan(state):
    """Go somewhere, and scan sometimes."""
    sweep(state)
    if state["draw"].below(2):
        state["action"] = {"node_id": state["action"], "do": {"scan": {}}}


def halt(ctx):
    """Refuse the moves of some agents, and their deeds."""
    for name, move in ctx.game.moves.items():
        if (len(move.path) + ctx.game.turn + move.start) % 5 == 0:
            ctx.game.refuse(name, "halt")
    for deed in ctx.game.performed():
        if (deed.at + ctx.game.turn) % 3 == 0:
            ctx.game.refuse(deed.agent, "too loud", deed="scan")


def guarded(ctx):
    """Do nothing after turns: the rule is there for its check."""


guarded.check = halt


def shove(ctx):
    """Note how agents are about to move; put some elsewhere, or out of the game."""
    look(ctx)
    draw = ctx.stream("shove", ctx.game.turn, len(ctx.game.events))
    for agent in ctx.game.agents:
        lot = draw.random()
        if lot < 0.05:
            ctx.game.eliminate(agent)
        elif lot < 0.2:
            ctx.game.respawn(agent)
        elif lot < 0.3:
            agent.current_node_id = 5


@gamms.array_rule
def meter(turn):
    """Note where agents are about to go, and how."""
    visits = turn.visits(turn.alive | turn.took_part)
    when = {"since": visits.begin.tolist(), "until": visits.end.tolist()}
    turn.emit("meter", visits.at, agents={"agent": visits.agents}, nodes={"node": visits.nodes}, values=when)
    there = turn.is_there_by_move
    turn.emit("there", np.arange(len(turn.games)), values={"agents": [repr(one.tolist()) for one in there]})


def last_by_name(contest, ctx):
    return [max(contest.movers)]


MOTIONS = {
    "one edge": ({}, None),
    "edges": ({}, 2.5),
    "metres": ({"speed_unit": "metres"}, 14.0),
    "metres, at arrivals": ({"speed_unit": "metres", "decide": "arrival"}, 23.0),
}
RULES = [TAG, {"rule": "capture_flag", "with": {"flags": {"red": 3, "blue": 12}, "goal": None}}]


def sweep(state):
    """Go somewhere, and remember what was seen on the way."""
    state["memory"]["seen"] = [*state["memory"].get("seen", []), state.get("xy"), state["blocked"]]
    state["action"] = state["draw"].choice(state["legal"])


def look(ctx):
    """Note how agents have moved."""
    tracks = {name: (list(one.path), one.legs) for name, one in ctx.game.moves.items()}
    ctx.game.emit("look", what=repr(tracks))


@pytest.mark.parametrize(
    "more", [[], [toll], [look], [sweep], [look, sweep]], ids=["core", "arrays", "rule", "own", "both"]
)
@pytest.mark.parametrize("motion", MOTIONS)
def test_teams_with_speeds_play_one_after_another_as_alone(motion, more):
    settings, speed = MOTIONS[motion]
    scenario = scene(RULES, side=4, max_turns=8, settings=settings | {"order": [["blue"], ["red"]]})
    with scenario.build(seed=1) as ctx:
        for number, agent in enumerate(ctx.agent.create_iter()):
            agent.speed = [speed, None, speed and 0.3 * speed][number % 3]
            if sweep in more and number % 2:
                agent.strategy = sweep
        ctx.game.conflicts = Conflicts(2)
        for rule in (one for one in more if one is not sweep):
            ctx.game.add(rule)
        results = check(ctx, SEEDS)
    assert any(event["kind"] == "tag" for result in results for event in result.events)


@pytest.mark.parametrize("phase", ["deeds", "after"])
@pytest.mark.parametrize(
    "acting", [[guarded], [shove], [meter], [guarded, shove, meter]], ids=["check", "rule", "arrays", "all"]
)
@pytest.mark.parametrize("motion", MOTIONS)
def test_functions_are_called_before_teams_with_speeds_move_one_after_another(motion, acting, phase):
    settings, speed = MOTIONS[motion]
    given = settings | {"order": [["blue"], ["red"], ["green"]], "deeds": DEEDS}
    teams = {team: {"count": 3 - number, "strategy": WALK} for number, team in enumerate(["red", "blue", "green"])}
    scenario = scene(RULES, side=4, max_turns=8, settings=given, teams=teams)
    with scenario.build(seed=1) as ctx:
        for number, agent in enumerate(ctx.agent.create_iter()):
            agent.speed = [speed, None, speed and 0.3 * speed][number % 3]
            if number % 2:
                agent.strategy = scan
        ctx.game.conflicts = Conflicts(1, resolve=last_by_name)
        for rule in acting:
            ctx.game.add(rule, phase=phase)
        ctx.game.add(look)
        check(ctx, SEEDS[:10])

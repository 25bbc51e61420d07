"""Batches that begin in the middle of a game, in arrays: what agents remember there, and how they moved last."""

from fractions import Fraction

import numpy as np
import pytest
from batch_scenes import assert_as_alone, check_games, plain, scene
from hypothesis import HealthCheck, settings

import gamms
from gamms.errors import UnknownName
from gamms.game.plan import find_first_called
from gamms.strategies import (
    assign,
    chase,
    first,
    follow_path,
    goto,
    mix,
    patrol,
    random_walk,
    random_waypoints,
    stay,
    sweep,
    unblock,
)

LAWS = settings(max_examples=6, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.too_slow])
SIGHT = {"near": {"type": "AGENT_RANGE", "sensor_range": 15.0}}
MADE = {
    "patrol": lambda ctx: patrol(ctx, [3, 3, 12, 5]),
    "follow_path": lambda ctx: first(follow_path(ctx, [6, 1], otherwise=None), patrol(ctx, [9, 0])),
    "random_waypoints": lambda ctx: random_waypoints(ctx, pause=2),
    "unblock": lambda ctx: unblock(random_waypoints(ctx, [5, 10], pause=1), after=1),
    "sweep": lambda ctx: sweep(ctx, repeat=True),
    "sweep by sight": lambda ctx: sweep(ctx, [2, 7, 8, 15], by_sight=True, repeat=True),
    "assign": lambda ctx: assign(ctx, patience=2),
    "mix": lambda ctx: mix(0.5, chase(ctx), patrol(ctx, [3, 3, 12, 5])),
}
MOTIONS = [
    {},
    {"order": [["blue"], ["red"]]},
    {"team_memory": False},
    {"speed_unit": "metres"},
    {"speed_unit": "metres", "decide": "arrival"},
]


def check(ctx, seeds=(3, 4), rounds=2):
    """Check that a batch is played in arrays, again after a reset, as the games alone; return what slows it down."""
    with ctx.game.batch(seeds=seeds) as games, ctx.game.fork(0).ctx as alone:
        for _ in range(rounds):
            games.run()
            assert_as_alone(games, alone)
            why = find_first_called(games.game, games.roster) or next(iter(games.detached.values()), None)
            games.reset()
        return why


def remembering(strategies, options=(), max_turns=13):
    """A scenario in which agents with sight are tagged, stop each other, and play these strategies in turn."""
    rules = [
        {"rule": "tag", "with": {"taggers": "red", "tagged": "blue", "then": "eliminate"}},
        {"rule": "respawn", "with": {"after": 3}},
    ]
    more = {"sensors": SIGHT, "conflicts": {"capacity": 1}, "settings": dict(options)}
    scenario = scene(rules, side=4, max_turns=max_turns, **more)
    given = {f"teams.{team}.sensors": ["near"] for team in ("red", "blue")}
    given |= {f"teams.{team}.speed": 7.0 for team in ("red", "blue") if "speed_unit" in more["settings"]}
    ctx = scenario.replace(**given).build(seed=5)
    for number, agent in enumerate(ctx.agent.agents.values()):
        agent.register_strategy(MADE[strategies[number % len(strategies)]](ctx))
    return ctx


@pytest.mark.parametrize("options", MOTIONS[1:4])
def test_agents_that_were_deleted_are_in_the_results_of_games_that_go_on_in_arrays(options):
    with remembering(["unblock", "random_waypoints", "assign"], options, max_turns=9) as ctx:
        for turn in range(4):
            ctx.game.step()
            ctx.agent.delete_agent(("red_1", "blue_0", "red_0", "blue_1")[turn])
        ctx.agent.create_agent("red_0", start_node_id=5, team="red", strategy=random_walk, speed=7.0 if options else 1)
        ctx.agent.create_agent("aa", start_node_id=5, team="red", strategy=random_walk, speed=7.0 if options else 1)
        check(ctx)
        with ctx.game.batch(1, most_agents={"red": ["red_1"]}) as games:
            assert [*games.result(0).agents] == ["aa", "blue_0", "blue_1", "blue_2", "red_0", "red_1", "red_2"]
            assert [*games.result(0).provenance["strategies"]] == ["aa", "blue_2", "red_0", "red_2"]


def delete_carrier(ctx):
    assert ctx.game.facts["flags"]["red"]["carrier"] == "blue_0"
    ctx.agent.delete_agent("blue_0")


def delete_team(ctx):
    for name in ("red_0", "red_1", "red_2"):
        ctx.agent.delete_agent(name)


@pytest.mark.parametrize(
    ("delete", "delay_turns", "why"),
    [
        (delete_carrier, 0, None),
        (lambda ctx: ctx.agent.delete_agent("red_1"), 2, "the strategy chase(ctx)"),
        (delete_team, 0, None),
        (lambda ctx: ctx.agent.delete_agent("red_1"), 0, None),
    ],
)
def test_games_go_on_where_rules_still_know_of_agents_that_were_deleted(delete, delay_turns, why):
    sensors = {"near": {"type": "AGENT_RANGE", "sensor_range": 90.0, "delay_turns": delay_turns}}
    team = {"count": 3, "strategy": "gamms.strategies:chase", "sensors": ["near"]}
    flags = {"rule": "capture_flag", "with": {"flags": {"red": 5, "blue": 6}}}
    scenario = scene([flags], side=4, teams={"red": team, "blue": team}, sensors=sensors, max_turns=9)
    with scenario.build(seed=1) as ctx:
        carrier = ctx.agent.get_agent("blue_0")
        carrier.current_node_id, carrier.strategy = 5, stay
        ctx.game.step()
        delete(ctx)
        assert check(ctx, rounds=1) == why


def test_a_memory_that_the_strategy_has_not_written_is_read_by_the_strategy_itself():
    with remembering(["patrol", "random_waypoints"]) as ctx:
        ctx.game.step()
        for memory in ctx.game.memories.values():
            memory["patrol [3, 3, 12, 5]"] = 2.0
        with ctx.game.batch(1) as games:
            assert find_first_called(games.game, games.roster).startswith("the strategy patrol(")
            assert games.is_in_arrays


def test_scores_that_no_float_holds_are_exact():
    def pay(ctx):
        ctx.game.scores["red"] += 1
        ctx.game.scores["share"] += Fraction(1, 3)
        ctx.game.scores["much"] *= 3

    tag = {"rule": "tag", "with": {"taggers": "red", "tagged": "blue"}}
    flags = {"rule": "capture_flag", "with": {"flags": {"red": 0, "blue": 8}, "goal": None}}
    with scene([tag, flags], side=3).build(seed=1) as ctx:
        ctx.game.step()
        ctx.game.scores.update(red=(1 << 60) + 1, share=Fraction(1, 7), flag=True, half=0.5)
        assert check(ctx) == "the rule 'tag'"
        ctx.game.scores["much"] = 10**30
        ctx.game.add(pay)
        assert check(ctx) == "the rule 'tag'"
        with ctx.game.batch(2) as games:
            games.step()
            assert games.is_in_arrays
            assert games.scores["much"].tolist() == [3 * 10**30] * 2


@gamms.array_rule
def gates(turn):
    """Note which agents were at some nodes in the turn, and when."""
    found = turn.visits(turn.streets.columns.node_ids % 2 == 0)
    times = {"begin": found.begin.tolist(), "end": found.end.tolist()}
    turn.emit("gate", found.at, agents={"agent": found.agents}, nodes={"node": found.nodes}, values=times)


def test_games_that_are_reset_have_the_last_moves_of_their_beginning_beside_others_that_went_on():
    with scene(side=4, max_turns=8, settings={"order": [["blue"], ["red"]]}).build(seed=3) as ctx:
        ctx.game.add(gates, phase="before")
        ctx.game.step()
        with ctx.game.batch(seeds=[1, 2]) as games, ctx.game.fork(0).ctx as alone:
            games.step()
            games.reset([1], seeds=[7])
            games.run()
            assert_as_alone(games, alone)


@gamms.array_rule
def number_turns(turn):
    """Count the turns of each agent, and score the counts of those that are there."""
    kept = turn.keep("turns", lambda games: {"turns": np.zeros((games, len(turn.roster.names)), np.int64)})
    kept["turns"][turn.games] += 1
    turn.add_score("turns", np.arange(len(turn.games)), (kept["turns"][turn.games] * turn.alive).sum(axis=1))


def test_memory_of_array_rules_has_rows_for_agents_that_come_later():
    with scene(side=4, red=2).build(seed=3) as ctx:
        ctx.game.add(number_turns)
        ctx.game.step()
        with ctx.game.batch(2) as games, ctx.game.batch(2, most_agents=4) as more:
            for one in (games, more):
                one.run()
            assert more.observe("red").mask.shape == (2, 4)
            assert [plain(more.result(number)) for number in (0, 1)] == [
                plain(games.result(number)) for number in (0, 1)
            ]


def test_rules_before_turns_look_along_no_node_that_was_removed():
    with (
        scene(side=4)
        .replace(**{"teams.red.speed": 3, "teams.red.count": 1, "teams.blue.count": 1})
        .build(seed=1) as ctx
    ):
        ctx.game.add(gates, phase="before")
        ctx.agent.get_agent("red_0").register_strategy(goto(ctx, 15))
        ctx.agent.get_agent("red_0").current_node_id = 0
        ctx.game.step()
        passed = ctx.game.moves["red_0"].path[1]
        ctx.graph.graph.remove_node(passed)
        for play in (ctx.game.step, lambda: ctx.game.batch(1)):
            with pytest.raises(UnknownName, match=f"Unknown node {passed}"):
                play()


@pytest.mark.parametrize("comes", [False, True])
def test_a_rule_that_lets_agents_come_or_go_before_the_first_moves_sees_the_last_ones(comes):
    def change(ctx):
        if ctx.game.turn == 2:
            if comes:
                ctx.agent.create_agent("red_9", start_node_id=3, team="red", strategy=stay)
            else:
                ctx.agent.delete_agent("blue_0")

    def look(ctx):
        agents = ctx.game.agents
        paths = [[list(track.path), list(track.times)] for track in ctx.game.tracks(agents)]
        ctx.game.emit("seen", paths=dict(zip([agent.name for agent in agents], paths, strict=True)))

    with scene([], max_turns=4).build(seed=1) as ctx:
        ctx.game.add(change, phase="before")
        ctx.game.add(look, phase="before")
        for _ in range(2):
            ctx.game.step()
        for result in check_games(ctx, 3, most_agents={"red": ["red_9"]}):
            assert result.turns == 4

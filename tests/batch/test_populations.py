"""Agents that rules create and delete in batches, without rows that the caller has reserved."""

import inspect

import numpy as np
import pytest
from batch_scenes import WALK, assert_as_alone, assert_as_played, plain, scene

from gamms import rl
from gamms.rules import tag
from gamms.scenario import Scenario

NEAR = {"near": {"type": "AGENT_RANGE", "sensor_range": 25.0}}


def made(**options):
    teams = {
        "red": {"count": 2, "strategy": WALK, "sensors": ["near"]},
        "blue": {"count": 3, "strategy": WALK, "sensors": ["near"]},
    }
    return scene(teams=teams, sensors=NEAR, max_turns=12, **options)


def timid(state):
    """Remember who was seen, and go by their number."""
    seen = state["memory"].setdefault("seen", [])
    seen.extend(sorted(state["sensor"]["near"][1]) if "near" in state["sensor"] else ["nobody"])
    state["action"] = state["legal"][len(seen) % len(state["legal"])]


def look_around(ctx):
    """Note all that a rule sees of agents and how they move."""
    seen = [
        [one.name, one.team, one.alive, one.current_node_id, one.prev_node_id, ctx.game.start_node(one)]
        for one in ctx.agent.create_iter()
    ]
    moves = [[name, move.start, move.end, list(move.path)] for name, move in ctx.game.moves.items()]
    names = sorted(one.name for one in ctx.game.agents), sorted(ctx.sensor.sensors)
    ctx.game.emit("seen", agents=seen, moves=moves, names=[*map(list, names)])


def check(scenario, rules, seeds=(3, 1, 2, 8), order=None, strategies=None, **options):
    with scenario.build(seed=1, strategies=strategies) as ctx:
        ctx.game.order = order
        for rule, phase in rules:
            ctx.game.add(rule, phase=phase)
        with ctx.game.batch(seeds=seeds, **options) as games, ctx.game.fork(0).ctx as alone:
            for _ in range(4):
                games.step()
            games.reset([1])
            games.run()
            for number, seed in enumerate(games.seeds):
                alone.game.reset(seed=seed)
                result = alone.game.run()
                assert plain(games.result(number)) == plain(result)
                assert games.result(number).provenance == result.provenance
            return [games.result(number) for number in range(len(seeds))]


def test_counts_have_the_agents_that_are_in_the_game_or_were():
    def count(ctx):
        ctx.game.emit("counted", counts={name: dict(counts) for name, counts in ctx.game.counts.items()})

    def come_and_go(ctx):
        red = ctx.agent.get_agent("red_0")
        if ctx.game.turn in (3, 6):
            ctx.agent.create_agent("red_7", start_node_id=0, team="red", strategy=red.strategy)
        if ctx.game.turn in (4, 6 + ctx.seed % 2):
            ctx.agent.delete_agent("red_7")

    with made().build(seed=1) as ctx:
        ctx.game.add(count, phase="before")
        ctx.game.add(come_and_go)
        ctx.game.add(count, name="count_after")
        with ctx.game.batch(seeds=[1, 2], most_agents={"red": ["red_7", "red_8"]}) as games:
            games.run()
            for number in range(2):
                with ctx.game.fork(0).ctx as alone:
                    alone.game.reset(seed=games.seeds[number])
                    assert plain(games.result(number)) == plain(alone.game.run())
            first, *_, last = games.result(0).events
    assert "red_7" not in first["counts"]
    assert "red_7" in last["counts"]
    assert "red_8" not in last["counts"]


def test_an_agent_that_was_deleted_may_be_created_again():
    def replace(ctx):
        if ctx.game.turn == 2 + ctx.seed % 2:
            ctx.agent.delete_agent("blue_1")
            ctx.agent.create_agent("blue_1", start_node_id=7, team="blue", strategy=timid, born=ctx.seed)

    results = check(made(), [(replace, "after"), (look_around, "after")])
    assert all("blue_1" in result.agents for result in results)


def test_games_that_go_on_know_agents_that_were_deleted_before():
    with made().build(seed=1) as ctx:
        ctx.game.add(look_around)
        ctx.game.step()
        for name in ("red_0", "red_1"):
            ctx.agent.delete_agent(name)
        with ctx.game.batch(2) as games, ctx.game.fork(0).ctx as alone:
            games.run()
            assert games.teams == ("blue",)
            assert_as_alone(games, alone)


def test_agents_of_one_name_differ_between_games():
    def settle(ctx):
        if ctx.game.turn == 1:
            ctx.agent.create_agent("new", start_node_id=0, team=("red", "blue")[ctx.seed % 2])

    results = check(made(), [(settle, "after"), (look_around, "after")])
    assert {result.agents["new"]["team"] for result in results} == {"red", "blue"}


def test_agents_without_reserved_rows_are_not_observed_and_follow_their_strategies():
    def recruit(ctx):
        if ctx.game.turn == 1:
            ctx.agent.create_agent("red_9", start_node_id=12, team="red", strategy=timid)

    with made().build(seed=1) as ctx:
        ctx.game.add(recruit)
        with ctx.game.batch(2) as games:
            for _ in range(4):
                view = games.observe("red")
                games.step({"red": view.counts * 0})
            assert view["name"] == ("red_0", "red_1")
            agents = games.result(0).agents
            assert (agents["red_0"]["moves"], agents["red_9"]["moves"]) == (0, 3)


def test_actions_that_were_given_before_an_agent_came_are_given_again():
    def recruit(ctx):
        if ctx.game.turn == 3:
            ctx.agent.create_agent("a", start_node_id=12, team="red", strategy=timid)

    with made().build(seed=1) as ctx:
        ctx.game.add(recruit)
        with ctx.game.batch(2) as games:
            wanted = games.observe("red").counts - 1
            games.step({"red": wanted})
            node = games.observe("red")["curr_pos"].copy()
            for _ in range(3):
                games.step({"red": wanted * 0})
            assert (games.observe("red")["curr_pos"] == node).all()
            assert "a" in games.result(1).agents


@pytest.mark.parametrize(
    "act",
    [
        lambda ctx: setattr(ctx.agent.get_agent("red_0"), "strategy", timid),
        lambda ctx: setattr(ctx.agent.get_agent("red_0"), "strategy", None),
        lambda ctx: ctx.agent.get_agent("blue_1").deregister_sensor("near"),
        lambda ctx: ctx.agent.get_agent("red_1").register_sensor(
            "far", ctx.sensor.create_sensor(f"far {ctx.game.turn}", "AGENT_RANGE", sensor_range=90.0)
        ),
        lambda ctx: ctx.game.scores.update(luck=int(ctx.rng.integers(9))),
        lambda ctx: ctx.game.scores.update(seen=len(ctx.agent.get_agent("red_0").get_state()["sensor"]["near"][1])),
    ],
)
def test_rules_change_strategies_and_sensors_draw_and_look_in_some_games(act):
    def rule(ctx):
        if ctx.game.turn % 4 == 2 and (ctx.seed + ctx.game.turn) % 3:
            act(ctx)

    for strategies in ({}, {"red": timid, "blue": timid}):
        check(made(), [(rule, "after"), (look_around, "after"), (tag("red", "blue"), "after")], strategies=strategies)


def come_and_go(ctx):
    """Let an agent come and another one go, in turns that differ between seeds."""
    if ctx.game.turn == 2 + ctx.seed % 3:
        first = ctx.agent.get_agent("red_0")
        ctx.agent.create_agent("red_9", start_node_id=3, team="red", strategy=first.strategy, sensors=["watch"])
        ctx.agent.delete_agent("blue_0")
        ctx.game.emit("changed", names=sorted(ctx.agent.agents))


SCOUTED = {
    "rules": [{"rule": "tag", "with": {"taggers": "red", "tagged": "blue"}}, {"rule": "changes.py:come_and_go"}],
    "sensors": {"watch": {"type": "AGENT_RANGE", "sensor_range": 25.0}},
    "teams": {"red": {"count": 2, "strategy": WALK, "sensors": ["watch"]}, "blue": {"count": 2, "strategy": WALK}},
}


@pytest.fixture
def scouted(tmp_path):
    """A scenario in which agents come and go."""
    code = [inspect.getsource(come_and_go)]
    (tmp_path / "changes.py").write_text("".join(code))
    more = {"map": {"grid": {"width": 5, "height": 5}}, "max_turns": 8}
    return Scenario(**SCOUTED, **more, folder=tmp_path)


def test_games_with_changing_agents_are_recorded_and_shown(scouted, tmp_path):
    with scouted.batch(3) as games:
        for _ in range(5):
            games.step()
        for number in range(3):
            assert plain(games.context(number).game.result()) == plain(games.result(number))
        games.run()
        games.record(1, tmp_path / "batch.ggr")
        assert games.result(1) == scouted.play(seed=1, record=tmp_path / "alone.ggr")
    assert (tmp_path / "batch.ggr").read_bytes() == (tmp_path / "alone.ggr").read_bytes()


def test_agents_change_in_games_on_several_maps(scouted):
    maps = [{"grid": {"width": width, "height": 5}} for width in (4, 6)]
    with scouted.batch(6, maps=maps) as games:
        games.run()
        assert_as_played(games, scouted, maps=maps)


def test_environments_go_on_where_agents_change(scouted):
    environment = rl.vector_env(scouted, team="red", num_games=4)
    observed, _ = environment.reset(seed=1)
    shapes = {name: one.shape for name, one in observed.items()}
    for _ in range(20):
        observed, *_ = environment.step(np.zeros(environment.action_space.shape, np.int64))
        assert {name: one.shape for name, one in observed.items()} == shapes
    environment.close()


def test_a_flag_whose_carrier_was_deleted_is_dropped_at_its_base():
    def scatter(ctx):
        carriers = [flag["carrier"] for flag in ctx.game.facts["flags"].values()]
        if ctx.game.turn >= 3 and "red_1" in carriers:
            ctx.agent.delete_agent("red_1")

    with made(rules=[{"rule": "capture_flag", "with": {"flags": {"red": 0, "blue": 24}, "goal": None}}]).build() as ctx:
        carrier = ctx.agent.get_agent("red_1")
        carrier.current_node_id = 23
        carrier.register_strategy(lambda state: state.update(action=24 if state["turn"] == 0 else min(state["legal"])))
        ctx.game.add(scatter)
        with ctx.game.batch(seeds=[1, 2]) as games, ctx.game.fork(0).ctx as alone:
            games.run()
            assert_as_alone(games, alone)
            for number in range(2):
                assert [one["node"] for one in games.result(number).events if one["kind"] == "drop"] == [24]


def test_games_in_which_agents_come_without_reserved_rows_are_played_alone():
    def recruit(ctx):
        if ctx.game.turn % 3 == 0:
            node = ctx.game.agents[0].current_node_id
            ctx.agent.create_agent(f"new_{ctx.game.turn}_{node}", start_node_id=node, team="red", strategy=timid)

    with made().build(seed=1) as ctx:
        ctx.game.add(recruit)
        with ctx.game.batch(seeds=range(6)) as games, ctx.game.fork(0).ctx as alone:
            games.run(max_turns=5)
            games.run()
            assert not games.detached
            assert all("creates agents for which most_agents= has" in why for why in games.detached.values())
            assert_as_alone(games, alone)
            games.reset()
            assert not games.detached
            games.run()
            assert_as_alone(games, alone)


def test_games_in_which_agents_come_with_reserved_rows_stay_in_the_core():
    def recruit(ctx):
        if ctx.game.turn == 2 + ctx.seed % 3:
            ctx.agent.create_agent(f"new_{ctx.seed % 2}", start_node_id=ctx.seed, team="red", strategy=timid)

    with made().build(seed=1) as ctx:
        ctx.game.add(recruit)
        reserved = {"red": ["new_0", "new_1"]}
        with ctx.game.batch(seeds=range(6), most_agents=reserved) as games, ctx.game.fork(0).ctx as alone:
            games.run()
            assert not games.detached
            assert_as_alone(games, alone)

"""Agents that rules create in batches: where they are observed, they take rows that were reserved for them."""

import numpy as np
import pytest
from batch_scenes import plain, scene

from gamms.errors import BadValue, TooLarge, UnknownName
from gamms.rules import last_team

TAG = {"rule": "tag", "with": {"taggers": "red", "tagged": "blue"}}
NEAR = {"near": {"type": "AGENT_RANGE", "sensor_range": 25.0}}


def reinforce(ctx):
    """Let agents of a team come, in an order that is not that of their names, like the first of it."""
    turn = ctx.game.turn
    name = ("blue_4", "blue_3", "blue_5")[min(turn // 3, 2)]
    if (turn + ctx.seed) % 3 == 0 and name not in ctx.agent.agents:
        like = ctx.agent.get_agent("blue_0")
        ctx.agent.create_agent(
            name, start_node_id=turn, team="blue", strategy=like.strategy, sensors=dict(like.sensors), since=turn
        )


def follow(ctx):
    """Look at those that have come, and let them count."""
    for agent in ctx.agent.create_iter():
        since = getattr(agent, "since", None)
        if since is not None:
            ctx.game.emit("joined", agent=agent.name, since=since, at=agent.current_node_id, alive=agent.alive)
            agent.since = since + 1
    for name in [name for name in ctx.game.moves if name in ("blue_3", "blue_4")]:
        ctx.game.scores[name] += 1


def made(**options):
    red = {"count": 2, "strategy": "gamms.strategies:chase", "sensors": ["near"]}
    blue = {"count": 3, "strategy": "gamms.strategies:flee", "sensors": ["near"]}
    return scene([TAG], max_turns=14, teams={"red": red, "blue": blue}, sensors=NEAR, **options)


@pytest.mark.parametrize("phase", ["before", "deeds", "after"])
@pytest.mark.parametrize("order", [None, [["red"], ["blue"]]])
def test_agents_that_come_take_rows_of_their_team(phase, order):
    with made().build(seed=1) as ctx:
        ctx.game.order = order
        for rule in (reinforce, follow, last_team()):
            ctx.game.add(rule, phase="after" if rule is follow else phase)
        with ctx.game.batch(4, most_agents={"blue": 6}) as games, ctx.game.fork(0).ctx as alone:
            games.run()
            assert not games.detached
            for number, seed in enumerate(games.seeds):
                alone.game.reset(seed=seed)
                result = alone.game.run()
                assert plain(games.result(number)) == plain(result)
                assert games.result(number).provenance == result.provenance
            assert len(games.result(0).agents) > 5


def late(state):
    """Go by who was seen, as one hears of it later."""
    state["action"] = state["legal"][sum(state["sensor"]["near"][1].values()) % len(state["legal"])]


def join(ctx):
    """Let an agent come that has what the last one of its team has, but perhaps eyes of its own."""
    name, like = "blue_3", ctx.agent.get_agent("blue_2")
    if ctx.game.turn == 2 + ctx.seed % 3 and name not in ctx.agent.agents:
        given = {"strategy": like.strategy, "sensors": dict(like.sensors)}
        if ctx.seed % 2:
            eyes = ctx.sensor.create_sensor(f"eyes {ctx.seed}", "AGENT_RANGE", sensor_range=30.0, delay_turns=1)
            given["sensors"] = [eyes.sensor_id]
        ctx.agent.create_agent(name, start_node_id=3, team="blue", **given)


@pytest.mark.parametrize("chaser", ["gamms.strategies:chase", late])
@pytest.mark.parametrize("joiner", ["gamms.strategies:chase", "gamms.strategies:random_walk"])
def test_agents_may_come_where_sensors_report_late(chaser, joiner):
    sensors = {"near": {"type": "AGENT_ARC", "sensor_range": 25.0, "fov": 5.0, "delay_turns": 2, "detection": 0.8}}
    red = {"count": 2, "strategy": "gamms.strategies:chase", "sensors": ["near"]}
    blue = {"count": 3, "strategy": joiner, "sensors": ["near"]}
    given = {"settings": {"speed_unit": "metres"}, "sensors": sensors, "max_turns": 12}
    scenario = scene([TAG], teams={"red": red, "blue": blue}, **given)
    with scenario.build(seed=1, strategies={"red": chaser} if callable(chaser) else None) as ctx:
        ctx.game.add(join)
        with ctx.game.batch(4, most_agents={"blue": 4}) as games, ctx.game.fork(0).ctx as alone:
            games.run()
            for number, seed in enumerate(games.seeds):
                alone.game.reset(seed=seed)
                assert plain(games.result(number)) == plain(alone.game.run())
            assert len(games.result(0).agents) == 6


def test_rows_that_are_not_taken_are_not_there_and_those_that_are_act():
    with made().build(seed=1) as ctx:
        ctx.game.add(reinforce)
        with ctx.game.batch(seeds=[1, 2, 3], most_agents={"blue": 6}) as games:
            assert games.observe("blue")["name"] == tuple(f"blue_{number}" for number in range(6))
            assert (games.observe("blue").mask.sum(axis=1) == 3).all()
            assert "blue_3" not in games.result(0).agents
            for _ in range(4):
                games.step({"blue": games.observe("blue").counts - 1})
            view = games.observe("blue")
            assert view.mask.tolist()[2] == [True, True, True, True, False, False]
            assert games.result(2).agents["blue_3"]["node"] == view["curr_pos"][2, 3]
            games.reset([2])
            assert games.observe("blue").mask.tolist()[2] == [True] * 3 + [False] * 3


def test_sensors_of_agents_that_come_are_those_that_rules_have_made():
    def scout(ctx):
        if ctx.game.turn == 2 + ctx.seed % 2:
            eye = ctx.sensor.create_sensor("eye of blue_3", "AGENT_RANGE", sensor_range=8.0)
            strategy = ctx.agent.get_agent("red_0").strategy
            ctx.agent.create_agent("blue_3", start_node_id=12, team="blue", strategy=strategy, sensors=[eye.sensor_id])

    with made().build(seed=1) as ctx:
        ctx.game.add(scout)
        with ctx.game.batch(6, most_agents={"blue": ["blue_3"]}) as games, ctx.game.fork(0).ctx as alone:
            games.run()
            assert not games.detached
            for number, seed in enumerate(games.seeds):
                alone.game.reset(seed=seed)
                assert plain(games.result(number)) == plain(alone.game.run())


@pytest.mark.parametrize(
    ("most", "error", "message"),
    [
        ({"blue": 2}, BadValue, "has 3 agents"),
        ({"green": 2}, UnknownName, "green"),
        ({"blue": ["red_0"]}, BadValue, "new agents, and 'red_0' is taken"),
        ({"blue": ["x", "x"]}, BadValue, "a name twice: .*'x'"),
        ({"blue": 10**12}, TooLarge, r"most_agents\['blue'\]=1000000000000 would take"),
    ],
)
def test_rows_that_cannot_be_reserved_are_refused(most, error, message):
    with made().build(seed=1) as ctx, pytest.raises(error, match=message):
        ctx.game.batch(2, most_agents=most)


def test_games_that_are_played_one_by_one_have_the_same_rows():
    scenario = made()
    with scenario.build(seed=1) as ctx:
        ctx.game.add(reinforce)
        with ctx.game.batch(seeds=[3], most_agents={"blue": 6}) as games:
            assert games.slow == "the rule 'reinforce'"
            for _ in range(4):
                view = games.observe("blue")
                games.step({"blue": np.zeros(view.mask.shape, np.int64)})
            assert games.observe("blue").mask.tolist() == [[True, True, True, True, False, False]]


def test_agents_that_have_not_come_have_begun_nowhere():
    goal = {"rule": "reach", "with": {"team": "red", "nodes": "starts of blue"}}
    scenario, seeds = made().replace(rules=[goal], **{"teams.red.strategy": "gamms.strategies:stay"}), [1, 2, 3]
    with scenario.batch(seeds=seeds, most_agents={"blue": 5}) as games:
        games.run()
        assert [games.result(number) for number in range(3)] == [scenario.play(seed=seed) for seed in seeds]


def test_agents_that_come_without_sensors_are_observed_one_by_one():
    def recruit(ctx):
        if ctx.game.turn == 1:
            ctx.agent.create_agent("red_1", start_node_id=0, team="red")

    late = {"late": {"type": "AGENT_RANGE", "sensor_range": 1000.0, "delay_turns": 1}, "all": {"type": "MAP"}}
    teams = {"red": {"count": 1, "sensors": ["late", "all"]}, "blue": {"count": 1}}
    with scene(sensors=late, teams=teams).build(seed=1) as ctx:
        ctx.game.add(recruit)
        games = ctx.game.batch(2, most_agents={"red": 2})
        for _ in range(3):
            games.step()
        assert games.observe("red").mask.all()
        assert games.observe("red").seen().mask[0].tolist() == [[True, False, True], [False] * 3]  # it carries none
        assert games.observe("red").seen_nodes().mask[0].all(axis=1).tolist() == [True, False]

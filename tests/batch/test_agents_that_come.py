"""Agents that rules create in batches: where they are observed, they take rows that were reserved for them."""

import pytest
from batch_scenes import check_games, scene

from gamms.errors import BadValue, TooLarge, UnknownName

TAG = {"rule": "tag", "with": {"taggers": "red", "tagged": "blue"}}
NEAR = {"near": {"type": "AGENT_RANGE", "sensor_range": 25.0}}


def made(**options):
    red = {"count": 2, "strategy": "gamms.strategies:chase", "sensors": ["near"]}
    blue = {"count": 3, "strategy": "gamms.strategies:flee", "sensors": ["near"]}
    return scene([TAG], max_turns=14, teams={"red": red, "blue": blue}, sensors=NEAR, **options)


def late(state):
    """Go by who was seen, as one hears of it later."""
    state["action"] = state["legal"][sum(state["sensor"]["near"][1].values()) % len(state["legal"])]


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


def test_a_game_leaves_its_batch_in_a_turn_in_which_an_agent_goes_that_had_come_before_the_batch():
    def dismiss(ctx):
        if ctx.game.turn == 2:
            ctx.agent.delete_agent("red_9")

    def recruit(ctx):
        if ctx.game.turn % 2 == 0:
            sensors = dict(ctx.agent.get_agent("red_0").sensors)
            name = f"red_{9 + ctx.game.turn}"
            ctx.agent.create_agent(name, start_node_id=0, team="red", strategy=late, sensors=sensors)

    with made().build(seed=1, strategies={"red": late}) as ctx:
        for rule in (dismiss, recruit):
            ctx.game.add(rule, phase="deeds")
        ctx.game.step()
        assert check_games(ctx, 1)[0].turns == 14


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


def visit(ctx):
    """Let agents come in every third turn, and leave after two."""
    turn, visitors = ctx.game.turn, ctx.game.data.setdefault("visitors", [])
    if turn % 3 == 1:
        visitors.append(f"visitor_{turn}")
        ctx.agent.create_agent(visitors[-1], start_node_id=(turn + ctx.seed) % 9, team="red", strategy=late_or_first)
    elif turn % 3 == 0:
        ctx.agent.delete_agent(visitors[-1])


def late_or_first(state):
    state["action"] = state["legal"][state["turn"] % len(state["legal"])]


def test_agents_are_changed_after_they_have_come():
    def hurry(ctx):
        for agent in ctx.agent.create_iter():
            agent.speed = 1.0 + ctx.game.turn

    with made().build(seed=1) as ctx:
        ctx.game.add(visit)
        ctx.game.add(hurry)
        check_games(ctx, seeds=[5, 6])

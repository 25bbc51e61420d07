"""Agents that come during a recording keep their strategies when the game is resumed, or are named."""

import io

import pytest

import gamms
from gamms.strategies import goto, random_walk


def wander(state):
    state["action"] = state["draw"].choice(state["legal"])


def game_with(make):
    """Return a game in which a rule creates an agent with the strategy that `make(ctx)` returns."""

    def reinforce(ctx):
        if ctx.game.turn == 3:
            ctx.agent.create_agent("new", start_node_id=0, team="red", strategy=make(ctx))

    ctx = gamms.create_context(seed=5, logger_config={"level": "WARNING"})
    ctx.graph.attach_networkx_graph(gamms.graph.grid(4, 4))
    for name, team in (("ann", "red"), ("bob", "blue")):
        ctx.agent.create_agent(name, start_node_id=5, team=team, strategy=random_walk)
    ctx.game.add(reinforce)
    return ctx


def recorded(make):
    stream = io.BytesIO()
    with game_with(make) as ctx:
        result = ctx.game.run(10, record=stream)
    stream.seek(0)
    return gamms.recorder.open(stream), result


def ends(result):
    return {name: one["node"] for name, one in result.agents.items()}


def test_a_newcomer_gets_the_plain_function_that_another_agent_has(caplog):
    recording, first = recorded(lambda ctx: random_walk)
    with recording, recording.resume(6, ctx=game_with(lambda ctx: random_walk)) as ctx:
        assert ends(ctx.game.run(4)) == ends(first)
    with recording, recording.resume(6, strategies={"ann": random_walk, "bob": random_walk}) as ctx:
        assert ends(ctx.game.run(4)) == ends(first)
    assert caplog.messages == []


def test_a_newcomer_in_a_team_of_its_own_is_named(caplog):
    def found(ctx):
        if ctx.game.turn == 3:
            ctx.agent.create_agent("new", start_node_id=0, team="green", strategy=wander)

    stream = io.BytesIO()
    with game_with(lambda ctx: wander) as ctx:
        ctx.game.remove("reinforce")
        ctx.game.add(found)
        ctx.game.run(10, record=stream)
    stream.seek(0)
    with gamms.recorder.open(stream) as recording, recording.resume(6, ctx=game_with(lambda ctx: wander)) as ctx:
        ctx.game.step()
    assert caplog.messages == [SAID]


SAID = (
    "resume: no strategy decides for agents that came during the recording, 'new': they stay where they are. "
    "Give them, resume(…, strategies={'new': …}), by agent or team."
)


@pytest.mark.parametrize("make", [lambda ctx: wander, lambda ctx: goto(ctx, 15)], ids=["own", "made"])
def test_a_newcomer_with_another_strategy_is_named(make, caplog):
    recording, first = recorded(make)
    with recording, recording.resume(6, ctx=game_with(make)) as ctx:
        assert ctx.agent.get_agent("new").strategy is None
    assert caplog.messages == [SAID]
    caplog.clear()
    with recording, game_with(make) as ctx:
        recording.resume(6, {"new": make(ctx)}, ctx=ctx)
        assert ends(ctx.game.run(4)) == ends(first)
    assert caplog.messages == []


def test_agents_that_the_caller_leaves_without_a_strategy_are_not_named(caplog):
    recording, _ = recorded(lambda ctx: wander)
    with recording, recording.resume(6):
        pass
    with recording, recording.resume(6, strategies={"blue": random_walk}):
        pass
    with game_with(lambda ctx: wander) as ctx:
        ctx.agent.get_agent("bob").strategy = None
        recording.resume(6, {"new": wander}, ctx=ctx)
        assert ctx.agent.get_agent("bob").strategy is None
    with game_with(lambda ctx: wander) as ctx:
        ctx.game.command("red", lambda states: None)
        recording.resume(6, ctx=ctx)
    assert caplog.messages == []


def test_a_newcomer_cannot_be_named_before_it_came(caplog):
    recording, first = recorded(lambda ctx: wander)
    with recording, recording.resume(2, ctx=game_with(lambda ctx: wander)) as ctx:
        assert ends(ctx.game.run(8)) == ends(first)
    assert caplog.messages == []


def test_many_newcomers_are_named_in_one_warning(caplog):
    def crowd(ctx):
        for number in range(7):
            ctx.agent.create_agent(f"new{number}", start_node_id=0, team="red", strategy=wander)
        return wander

    recording, _ = recorded(crowd)
    with recording, recording.resume(6, ctx=game_with(crowd)):
        pass
    (said,) = caplog.messages
    assert "'new0', 'new1', 'new2', 'new3', 'new4' and 3 more: they stay" in said

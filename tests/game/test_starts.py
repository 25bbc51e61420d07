"""Where an agent has started: where it was created, however the game goes on."""

import copy
import io

import gamms
from gamms.rules import respawn


def onward(state):
    state["action"] = state["legal"][-1]


def born(ctx):
    """Create an agent on node 5, put it on another node at once, and eliminate it later."""
    if ctx.game.turn == 2:
        ctx.agent.create_agent("new", start_node_id=5, team="red", strategy=onward)
        ctx.agent.get_agent("new").current_node_id = 8
    if ctx.game.turn == 6:
        ctx.game.eliminate("new")
    if "new" in ctx.agent.agents:
        ctx.game.emit("told", start=ctx.game.start_node("new"), node=ctx.agent.get_agent("new").current_node_id)


def game():
    ctx = gamms.create_context(seed=1, logger_config={"level": "CRITICAL"})
    ctx.graph.attach_networkx_graph(gamms.graph.grid(4, 4))
    ctx.agent.create_agent("old", start_node_id=1, team="red", strategy=onward)
    ctx.game.add(born)
    ctx.game.add(respawn(after=1))
    return ctx


def events_of(ctx, turns):
    return ctx.game.run(turns).events


def test_an_agent_that_is_created_in_a_game_returns_to_where_it_was_created():
    with game() as ctx:
        events = events_of(ctx, 9)
    assert {event["start"] for event in events if event["kind"] == "told"} == {5}
    assert [event["node"] for event in events if event["kind"] == "respawned"] == [5]


def test_copies_forks_batches_and_resumed_games_know_the_start_as_well():
    stream = io.BytesIO()
    with game() as ctx:
        whole = ctx.game.run(9, record=stream).events
    with game() as ctx:
        ctx.game.run(4)
        others = [copy.deepcopy(ctx), ctx.game.fork(1).ctx]
        with ctx.game.batch(seeds=[1]) as games:
            games.run(5)
            assert games.result(0).events == whole
        assert ctx.game.run(5).events == whole
        for other in others:
            assert events_of(other, 5) == whole
            other.terminate()
    stream.seek(0)
    with gamms.recorder.open(stream) as recording, recording.resume(4, ctx=game()) as resumed:
        resumed.agent.get_agent("new").register_strategy(onward)
        assert events_of(resumed, 5) == whole


def test_an_agent_deleted_and_created_again_has_a_new_start():
    with game() as ctx:
        ctx.game.run(3)
        ctx.agent.delete_agent("old")
        ctx.agent.create_agent("old", start_node_id=12, team="red", strategy=onward)
        ctx.game.run(2)
        assert ctx.game.start_node("old") == 12
        ctx.game.reset(1)
        assert ctx.game.start_node("old") == 1

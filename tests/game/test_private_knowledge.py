"""What only a team or an agent knows: private facts, and games without a shared memory."""

import io
import pickle
from copy import deepcopy

import pytest

import gamms
from gamms.errors import BadType, BadValue, UnknownName


@pytest.fixture
def world():
    ctx = gamms.create_context(seed=1, logger_config={"level": "ERROR"})
    ctx.graph.attach_networkx_graph(gamms.graph.grid(3, 3))
    ctx.seen = {}

    def strategy(state):
        ctx.seen[state["name"]] = {**state, "facts": state["facts"].copy()}
        if "team_memory" in state:
            state["team_memory"]["was here"] = state["name"]
        state["action"] = state["curr_pos"]

    for name, team in (("ann", "red"), ("amy", "red"), ("bob", "blue"), ("cat", None)):
        ctx.agent.create_agent(name, start_node_id=0, team=team, strategy=strategy)
    yield ctx
    ctx.terminate()


def facts(ctx):
    ctx.game.step()
    return {name: state["facts"] for name, state in ctx.seen.items()}


def test_a_fact_for_a_team_or_an_agent_reaches_no_other(world):
    world.game.publish(place="park", to="red", time=5)
    world.game.publish(word="fox", to="bob")
    world.game.publish(place="everywhere")
    world.game.publish(place="hole", to=world.agent.get_agent("amy"))
    assert facts(world) == {
        "ann": {"place": "park", "time": 5},
        "amy": {"place": "hole", "time": 5},
        "bob": {"place": "everywhere", "word": "fox"},
        "cat": {"place": "everywhere"},
    }
    assert dict(world.game.facts) == {"place": "everywhere"}
    assert world.game.facts_of("red") == {"place": "park", "time": 5}
    assert world.game.facts_of("cat") == {}


def test_later_facts_are_visible_and_read_only(world):
    assert facts(world)["ann"] == {}
    world.game.publish(to="red", nodes=[1, 2])
    assert facts(world)["ann"] == {"nodes": (1, 2)}
    state = world.agent.get_agent("ann").state
    with pytest.raises(TypeError, match="read-only"):
        state["facts"]["nodes"] = ()
    assert deepcopy(state["facts"]) == pickle.loads(pickle.dumps(state["facts"])) == {"nodes": (1, 2)}
    assert repr(state["facts"]) == "{'nodes': (1, 2)}"


def test_a_strategy_cannot_read_facts_told_to_others(world):
    world.game.publish(to="blue", word="fox")
    caught = []

    def spy(state):
        for call in (lambda: world.game.facts_of("blue"), lambda: world.game.publish(to="red", word="x")):
            try:
                caught.append(call())
            except gamms.errors.IllegalMutation as error:
                caught.append(str(error)[:60])
        state["action"] = state["curr_pos"]

    world.agent.get_agent("ann").register_strategy(spy)
    world.game.step()
    assert all("may not call ctx.game." in text for text in caught)
    assert len(caught) == 2


def test_a_plan_of_arrays_knows_the_messages_to_its_team(world):
    world.game.publish(to="red", word="fox")
    seen = []
    world.game.command("red", lambda arrays: seen.append(arrays.facts.copy()) or arrays.nodes, arrays=True)
    world.game.step()
    assert seen == [{"word": "fox"}]


def test_facts_without_a_recipient_are_refused(world):
    with pytest.raises(UnknownName, match="Unknown team or agent 'rad'"):
        world.game.publish(to="rad", word="fox")
    with pytest.raises(BadType, match="fact 'word' has an object"):
        world.game.publish(to="red", word=io.BytesIO())
    world.agent.create_agent("red", start_node_id=0, team="red")
    with pytest.raises(BadValue, match="'red' is an agent and a team"):
        world.game.publish(to="red", word="fox")
    world.game.publish(to=world.agent.get_agent("red"), word="fox")
    assert (world.game.facts_of(world.agent.get_agent("red")), facts(world)["ann"]) == ({"word": "fox"}, {})


def test_private_facts_are_restored_reset_and_go_on_from_recordings(world):
    def tell(ctx):
        ctx.game.publish(to="ann", turn=ctx.game.turn)
        if ctx.game.turn == 3:
            ctx.game.publish(to="blue", late=(1, {2}))

    world.game.add(tell)
    world.game.publish(to="red", word="fox")
    file = io.BytesIO()
    world.record.start(file)
    world.game.run(2)
    moment = world.game.fork(1)
    world.game.run(3)
    world.record.stop()
    with gamms.recorder.open(io.BytesIO(file.getvalue())) as recording:
        for turn in range(6):
            with recording.resume(turn) as ctx:
                found = [ctx.game.facts_of(to) for to in ("red", "ann", "blue")]
                late = {"late": (1, frozenset({2}))} if turn >= 3 else {}
                assert found == [{"word": "fox"}, {"turn": turn} if turn else {}, late]
                ctx.game.publish(to="red", word="dog")
                assert ctx.game.observation("ann")["facts"]["word"] == "dog"
    again = io.BytesIO()
    with gamms.create_context(seed=9, logger_config={"level": "ERROR"}) as ctx:
        ctx.record.start(again)
        for _ in ctx.record.replay(io.BytesIO(file.getvalue())):
            pass
        ctx.record.stop()
    assert again.getvalue() == file.getvalue()
    assert (moment.facts_of("ann"), moment.facts_of("blue")) == ({"turn": 2}, {})
    world.game.reset()
    assert (world.game.facts_of("ann"), world.game.facts_of("red")) == ({}, {"word": "fox"})


def test_without_team_memory_a_team_shares_nothing(world):
    world.game.team_memory = False
    world.game.run(2)
    assert "team_memory" not in world.seen["ann"]
    assert world.game.team_memories == {}
    world.agent.get_agent("ann").register_strategy(lambda state: state.update(team_memory={"a": 1}, action=0))
    world.game.run(1)
    assert world.game.team_memories == {}
    world.game.team_memory = True
    world.game.run(2)
    assert world.game.team_memories["blue"] == {"was here": "bob"}
    with pytest.raises(BadType, match="team_memory must be"):
        world.game.team_memory = "no"

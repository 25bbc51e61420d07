"""Messages of array strategies: heard, lost and jammed in batches as in games that are played alone."""

import numpy as np
import pytest
from batch_scenes import assert_as_alone, assert_as_played, scene

import gamms
from gamms.errors import BadType, BadValue, UnknownName
from gamms.game.movement.legality import IllegalAction

OUT = {"rule": "tag", "with": {"taggers": "red", "tagged": "blue", "mutual": True, "then": "eliminate"}}


def channels(**radio):
    return {
        "radio": {"range_m": 25.0, **radio},
        "mesh": {"range_m": 15.0, "teams": ["red"], "relay": True, "loss": 0.3},
    }


MAPS = [{"grid": {"width": 4, "height": 4}}, {"grid": {"width": 7, "height": 3}}]


@pytest.mark.parametrize(
    ("arguments", "kind", "message"),
    [
        (("phone", True, 1), UnknownName, "phone"),
        (("mesh", True, 1), BadValue, "not for team 'blue'"),
        (("radio", True, 1, "green"), UnknownName, "green"),
        (("radio", True, object()), BadType, "must be a plain value"),
        (("radio", True, 1, [3]), BadType, "an agent, a team or None"),
    ],
)
def test_impossible_messages_are_refused(arguments, kind, message):
    @gamms.array_strategy
    def speak(view):
        view.send(*arguments)
        return view.counts * 0

    scenario = scene([], channels=channels())
    with scenario.batch(2, strategies={"blue": speak}) as games, pytest.raises(kind, match=message):
        games.step()
    with scene([]).batch(2) as games:
        assert dict(games.observe("red")["inbox"]) == {}
        with pytest.raises(UnknownName, match="radio"):
            games.observe("red")["inbox"]["radio"]
        with pytest.raises(BadValue, match="the game has no channels"):
            games.observe("red").send("radio", True, 1)


@pytest.mark.parametrize("given", [{}, {"channels": channels()}])
def test_an_array_strategy_that_plays_alone_hears_no_unknown_channel(given):
    with pytest.raises(UnknownName, match="Unknown channel 'phone'"):
        scene([], **given).play(strategies={"blue": gamms.array_strategy(lambda view: view.heard("phone"))})


def leave(ctx):
    """Delete an agent."""
    if ctx.game.turn == 2:
        ctx.agent.delete_agent("blue_1")


@gamms.array_strategy
def call_the_deleted(view):
    view.send("radio", True, 1, "blue_1")
    return view.counts * 0


def call_the_deleted_plainly(state):
    state["outbox"].append({"channel": "radio", "body": 1, "to": "blue_1"})
    state["action"] = state["curr_pos"]


def test_a_message_to_a_deleted_agent_is_refused_alone_and_in_batches():
    game = scene([], channels=channels(), max_turns=4)

    def play(strategy):
        with game.build(2, strategies={"red": strategy}) as ctx:
            ctx.game.add(leave)
            with ctx.game.batch(1, seed=2) as games:
                games.run(warn=False)
                together = games.result(0)
            return ctx.game.run(4), together

    results = [*play(call_the_deleted), *play(call_the_deleted_plainly)]
    assert "Unknown agent or team 'blue_1'" in results[0].errors[0]["message"]
    assert {error["turn"] for error in results[0].errors} == {2, 3}
    assert all(one.errors == results[0].errors and one.messages == results[0].messages for one in results)


def chatter(state):
    """Send more than channels take, to agents of which one is the sender, and messages that are too large."""
    turn, names = state["turn"], ("red_0", "blue_1", None)
    bodies = [list(range(turn)), turn, "x" * (turn % 3), turn]
    receivers = [None, names[turn % 3], "blue", None]
    named = zip(("radio", "wire", "radio", "radio"), bodies, receivers, strict=True)
    state["outbox"].extend({"channel": name, "to": to, "body": body} for name, body, to in named)
    state["action"] = state["legal"][-1]


def plainly(state):
    """Do the same without an array form, and go where it is not legal in some turns."""
    chatter(state)
    if state["turn"] % 2:
        state["action"] = -1


def test_games_with_channels_on_several_maps_are_those_of_their_maps():
    scenario = scene([OUT], max_turns=6, channels=channels(hops=2, loss=0.2) | {"wire": {"hops": 9}})
    both = {"red": chatter, "blue": chatter}
    with scenario.batch(6, maps=MAPS, strategies=both) as games:
        games.run()
        games.reset([0, 1], seeds=[7, 8])
        games.run()
        assert games.is_in_arrays
        assert len(set(games.maps)) == 2
        assert_as_played(games, scenario, both, MAPS)


BOUNDED = {"radio": {"range_m": 25.0, "max_bytes_per_turn": 4}, "wire": {"hops": 9}}


@pytest.mark.parametrize("blue", [chatter, plainly])
def test_messages_that_cannot_be_sent_are_noted_as_in_games_that_are_played_alone(blue, same_as_one_by_one):
    scenario = scene([OUT], max_turns=7, channels=BOUNDED)
    both = {"red": chatter, "blue": blue}
    if blue is chatter:
        same_as_one_by_one(scenario, [3, 4], both)
    with scenario.batch(2, strategies=both) as games:
        games.run()
        assert_as_played(games, scenario, both)
        flaws = " ".join(error["message"] for error in games.result(0).errors)
    assert "state['outbox'][3]: Its body has 2 bytes; channel 'radio' takes 4 of each" in flaws
    assert "state['outbox'][1]: A message to 'red_0' would come to no agent but its sender." in flaws


def test_an_array_strategy_that_sends_too_much_is_refused_if_the_game_says_so():
    scenario = scene([], max_turns=7, channels=BOUNDED, settings={"on_illegal": "raise"})
    both = {"red": chatter, "blue": chatter}
    with pytest.raises(IllegalAction) as alone:
        scenario.play(strategies=both)
    with scenario.batch(2, strategies=both) as games, pytest.raises(IllegalAction) as in_arrays:
        games.run()
    assert str(in_arrays.value) == str(alone.value)
    assert in_arrays.value.__notes__[0] == "In game 0 of a batch, with the seed 0."


def summon(state):
    """Send something to an agent that may come, and to the own team."""
    state["outbox"] += [{"channel": "radio", "to": to, "body": state["turn"]} for to in ("red_3", "red")]
    state["action"] = state["curr_pos"]


def reinforce(ctx):
    if ctx.game.turn == 2 + ctx.seed % 2:
        strategy = ctx.agent.get_agent("red_0").strategy
        ctx.agent.create_agent("red_3", start_node_id=0, team="red", strategy=strategy)


@pytest.mark.parametrize("red", [1, 3])
def test_messages_to_agents_that_have_not_come_yet_are_errors(red):
    scenario = scene([], red=red, max_turns=5, channels={"radio": {"range_m": 40.0}})
    with scenario.build(seed=1, strategies={"red": summon, "blue": summon}) as ctx:
        ctx.game.add(reinforce)
        with ctx.game.batch(seeds=[4, 5], most_agents={"red": ["red_3"]}) as games, ctx.game.fork(0).ctx as alone:
            games.run()
            assert not games.detached
            assert_as_alone(games, alone)
        assert any("Unknown agent or team 'red_3'" in error["message"] for error in games.result(0).errors)


def tell(state):
    """Say something and rest; go to a node, stop on the way, and want to another one."""
    state["outbox"] += [{"channel": name, "to": None, "body": state["turn"]} for name in ("radio", "wire")]
    state["action"] = {"node_id": (1, None, 2, 2, 2, 2)[state["turn"]], "do": {"rest": None}}


@pytest.mark.parametrize("decide", ["turn", "arrival"])
def test_agents_whose_actions_are_not_legal_neither_send_nor_do_anything(decide):
    with gamms.create_context(logger_config={"level": "CRITICAL"}, game={"max_turns": 6}) as ctx:
        for node, x in ((0, 0), (1, 10), (2, -10)):
            ctx.graph.graph.add_node({"id": node, "x": x, "y": 0})
        for edge, (source, target) in enumerate([(0, 1), (0, 2), (2, 0)]):  # there is no way back from node 1
            ctx.graph.graph.add_edge({"id": edge, "source": source, "target": target, "length": 10.0})
        for name, node in (("a", 0), ("b", 2)):
            ctx.agent.create_agent(name, start_node_id=node, team="red", strategy=tell, speed=2.0)
        ctx.game.speed_unit, ctx.game.deeds = "metres", {"rest": {}}
        ctx.game.channels = {"radio": {"range_m": 99}, "wire": {"hops": 9, "max_bytes_per_turn": 1}}
        ctx.game.step()
        ctx.game.step()
        ctx.game.decide = decide
        with ctx.game.batch(seeds=[1, 2]) as games, ctx.game.fork(0).ctx as alone:
            games.run()
            flaws = {error["agent"] for error in games.result(0).errors if "outbox" not in error["message"]}
            assert flaws == {"a"}
            assert_as_alone(games, alone)


def call(state):
    """Call all others, and stay."""
    state["outbox"].append({"channel": "radio", "to": None, "body": 7})
    state["action"] = state["curr_pos"]


def test_an_array_strategy_alone_hears_an_agent_that_was_deleted():
    heard = []

    @gamms.array_strategy
    def listen(view):
        found = view.heard("radio")
        heard.append((found.senders.tolist(), found.bodies))
        return np.zeros_like(view.node)

    scenario = scene([], red=1, blue=1, channels={"radio": {"range_m": 99.0, "delay_turns": 2}})
    with scenario.build(strategies={"red": call, "blue": listen}) as ctx:
        ctx.game.step()
        ctx.agent.delete_agent("red_0")
        ctx.game.step()
        ctx.game.step()
    assert heard == [([], []), ([], []), ([-1], [7])]

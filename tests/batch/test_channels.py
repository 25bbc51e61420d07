"""Messages of array strategies: heard, lost and jammed in batches as in games that are played alone."""

import numpy as np
import pytest
from batch_scenes import plain, scene
from hypothesis import given, settings
from hypothesis import strategies as st
from test_laws import LAWS

import gamms
from gamms.errors import BadType, BadValue, UnknownName

OUT = {"rule": "tag", "with": {"taggers": "red", "tagged": "blue", "mutual": True, "then": "eliminate"}}


def talk(state):
    """Walk at random, tell others what was heard, and follow who tells much."""
    legal, draw = state["legal"], state["draw"]
    heard = [message for message in state["inbox"] if message["channel"] == "radio"]
    told = sum(message["body"] for message in heard if not message["overheard"])
    node = legal[(draw.below(len(legal)) + told) % len(legal)]
    if draw.random() < 0.7:
        body = len(heard) + state["turn"] - (heard[-1]["turn"] if heard else 0)
        state["outbox"].append({"channel": "radio", "to": None, "body": body})
    if state["team"] == "red":
        state["outbox"].append({"channel": "radio", "to": "red_0" if state["name"] != "red_0" else "blue", "body": 1})
        if draw.random() < 0.5:
            state["outbox"].append({"channel": "mesh", "to": "red", "body": {"at": state["curr_pos"], "x": [None]}})
    state["action"] = node


@gamms.array_strategy(of=talk)
def talk_in_arrays(view):
    heard, shape = view.heard("radio"), view.node.shape
    told, number, last = np.zeros(shape, np.int64), np.zeros(shape, np.int64), np.zeros(shape, np.int64)
    np.add.at(told, (heard.at, heard.hearers), np.where(heard.overheard, 0, np.array(heard.bodies, np.int64)))
    np.add.at(number, (heard.at, heard.hearers), 1)
    last[heard.at, heard.hearers] = heard.turns
    actions = (view.draw.below(view.counts) + told) % view.counts
    body = number + np.where(number > 0, view.turn[:, None] - last, view.turn[:, None])
    view.send("radio", view.draw.random() < 0.7, body)
    is_red = np.array([team == "red" for team in view["team"]])
    is_first = np.array([name == "red_0" for name in view["name"]])
    view.send("radio", is_red & ~is_first, 1, to="red_0")
    view.send("radio", is_red & is_first, 1, to="blue")
    places = np.empty(shape, object)
    places[:] = [[{"at": node, "x": [None]} for node in nodes] for nodes in view["curr_pos"].tolist()]
    reds = view.only(np.broadcast_to(is_red, shape))
    view.send("mesh", is_red & (reds.draw.random() < 0.5), places, to="red")
    return actions


def channels(**radio):
    return {
        "radio": {"range_m": 25.0, **radio},
        "mesh": {"range_m": 15.0, "teams": ["red"], "relay": True, "loss": 0.3},
    }


losses = st.sampled_from([None, 0.4, [[0, 0.1], [30, 0.9]]])
jammers = [{"agent": "blue_1", "radius_m": 12}, {"team": "blue", "radius_m": 9}, {"at": 12, "radius_m": 11}]
jammers.append({"at": [5.0, 5.0], "radius_m": 12})


@settings(LAWS, max_examples=8)
@given(
    loss=losses,
    relay=st.sampled_from([None, True, ["red", "blue_2"]]),
    hops=st.sampled_from([None, 1, 3]),
    delay=st.sampled_from([None, 2]),
    jammers=st.lists(st.sampled_from(jammers), max_size=2),
    listening=st.sampled_from([None, ["blue_0"], ["red", "blue_2"]]),
    how=st.sampled_from([None, "order", "metres"]),
    sight=st.booleans(),
    seed=st.integers(0, 2**62),
)
def test_messages_are_those_of_games_that_are_played_alone(
    loss, relay, hops, delay, jammers, listening, how, sight, seed
):
    radio = {"loss": loss, "relay": relay, "hops": hops, "delay_turns": delay, "jammers": jammers}
    if listening is not None:
        radio["eavesdroppers"] = listening
    scenario = scene([OUT], max_turns=6)
    with scenario.build(seed=1, strategies={"red": talk, "blue": talk}) as ctx:
        known = {key: value for key, value in radio.items() if value is not None} | {"line_of_sight": sight}
        ctx.game.channels = channels(**known)
        if sight:
            ctx.graph.add_obstacles([[(12, 3, 0), (13, 28, 0), (13, 28, 9), (12, 3, 9)]])
        if how == "metres":
            ctx.game.speed_unit = "metres"
            for number, agent in enumerate(ctx.game.agents):
                agent.speed = (6.5, 12.0, 23.0)[number % 3]
        ctx.game.order = [["blue"], ["red"]] if how == "order" else None
        with ctx.game.batch(seeds=[seed, 5]) as games, ctx.game.fork(0).ctx as alone:
            assert games.slow is None
            games.run()
            games.reset([0])
            games.run()
            for number, one in enumerate((seed, 5)):
                alone.game.reset(seed=one)
                assert plain(games.result(number)) == plain(alone.game.run())


def test_an_array_strategy_sends_and_hears_in_games_alone():
    told = gamms.array_strategy(talk_in_arrays)
    scenario = scene([OUT], max_turns=6, channels=channels())
    both = {"red": talk, "blue": talk}
    with scenario.batch(1, seed=3, strategies=both) as games:
        games.run()
        assert plain(games.result(0)) == plain(scenario.play(seed=3, strategies={"red": told, "blue": told}))
        assert len(games.result(0).messages) > 20


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
        with pytest.raises(UnknownName, match="radio"):
            games.observe("red").heard("radio")
        with pytest.raises(BadValue, match="there are no channels"):
            games.observe("red").send("radio", True, 1)


@pytest.mark.parametrize("given", [{}, {"channels": channels()}])
def test_an_array_strategy_that_plays_alone_hears_no_unknown_channel(given):
    with pytest.raises(UnknownName, match="Unknown channel 'phone'"):
        scene([], **given).play(strategies={"blue": gamms.array_strategy(lambda view: view.heard("phone"))})


def test_channels_without_an_array_form_are_named():
    with scene([], channels={"radio": {"range_m": 5.0, "max_bytes_per_turn": 9}}).batch(1) as games:
        assert "channel 'radio'" in games.slow

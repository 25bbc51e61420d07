"""Actions that are given to batches: moves, deeds and messages, in arrays and in games played one by one."""

import numpy as np
import pytest
from batch_scenes import WAYS, assert_as_shown, by_another_plan, plain, scene

import gamms
from gamms.errors import BadType, BadValue, UnknownName
from gamms.game.array_functions.given import as_kept

DEEDS = {
    "scan": {"node": "node"},
    "mark": {"whom": "agent?", "size": "number", "how": ["near", "far"]},
    "rest": {},
}
CHANNELS = {"radio": {"range_m": 30.0, "loss": 0.2}}
OUT = {"rule": "tag", "with": {"taggers": "blue", "tagged": "red", "then": "eliminate"}}


def given_scene(order=None):
    settings = {"deeds": DEEDS, "order": order}
    return scene(
        [OUT, {"rule": "cooldown", "with": {"deed": "scan", "turns": 2}}], settings=settings, channels=CHANNELS
    )


def actions_of(games):
    """Return what the reds do in this turn."""
    view, agents = games.observe("red"), np.arange(3)
    moves = (view.turn[:, None] + agents) % view.counts
    turn = np.broadcast_to(view.turn[:, None], moves.shape)
    deeds = {
        "scan": (turn % 2 == 0, {"node": view.streets.step(view.node, moves)}),
        "mark": (agents + turn > 1, {"whom": np.where(turn % 3 == 0, 1, -1), "size": turn / 2, "how": "near"}),
        "rest": view.turn[:, None] % 5 == 0,
    }
    messages = {"radio": (view.turn[:, None] % 2 == 1, np.stack((turn, moves), axis=-1), np.array([1, 2, 0]))}
    return {"moves": moves, "deeds": deeds, "messages": messages}


@pytest.mark.parametrize("action", [-1, 5, (1 << 32) - 1, 1 << 32, 1 << 61])
def test_a_number_beyond_the_legal_nodes_is_no_move(action):
    with scene().batch(2) as games:
        with pytest.raises(BadValue, match=f"action {action} of agent 'red_0' .* is not the number of a legal node"):
            games.step({"red": np.full((2, 3), action)})
        assert (games.turn == 0).all()


@pytest.mark.parametrize("order", [None, [["blue"], ["red"]]])
def test_deeds_and_messages_that_are_given_are_those_of_games_alone(order, tmp_path):
    scenario = given_scene(order)
    with scenario.batch(3, seed=4, record=True) as games:
        while not games.is_over.all():
            games.step({"red": actions_of(games)})
        assert_as_shown(games)
        results = [plain(games.result(number)) for number in range(3)]
        assert {deed["deed"] for deed in results[0]["deeds"]} == set(DEEDS)
        assert len({tuple(message["body"]) for message in results[0]["messages"]}) > 3
        games.record(1, tmp_path / "given.ggr")
        with gamms.recorder.open(tmp_path / "given.ggr") as recording:
            assert recording.turns == games.turn[1]


def test_numbers_of_nodes_that_are_kept_take_a_byte_each():
    moves = np.ones((2, 3), np.int64)
    assert as_kept(moves).dtype == np.uint8
    assert as_kept(moves * 300).tolist() == [[300] * 3] * 2
    assert as_kept(-moves).tolist() == [[-1] * 3] * 2
    assert as_kept(-moves).base is None


def test_a_team_that_is_given_no_moves_stays():
    with given_scene().batch(2) as games:
        before = games.observe("red").node.copy()
        games.step({"red": {"deeds": {"rest": True}}})
        deeds = games.result(0).deeds
        alive = games.observe("red").mask
        assert (games.observe("red").node == before)[alive].all()
        assert [deed["agent"] for deed in deeds] == ["red_0", "red_1", "red_2"]


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize(
    ("given", "kind", "message"),
    [
        (None, BadType, "its actions are None"),
        ([[0, 0, 0], [0]], BadType, r"numbers of legal nodes, not \[\[0, 0, 0\], \[0\]\]"),
        ({"move": 1}, UnknownName, "'move'"),
        ({"deeds": {"jump": True}}, UnknownName, "jump"),
        ({"deeds": {"scan": True}}, BadValue, "'node' of the deed 'scan'"),
        ({"deeds": {"scan": (True, {"nodes": 1})}}, UnknownName, "'nodes'"),
        ({"deeds": {"scan": (True, {"node": -2})}}, BadValue, "there is no node number -2"),
        ({"deeds": {"scan": (True, {"node": 1.0})}}, BadType, "nodes by their numbers, not 1.0"),
        ({"deeds": {"rest": np.zeros((2, 2), bool)}}, BadValue, r"does not broadcast to \(2, 3\)"),
        ({"messages": {"radio": True}}, BadType, r"\(where, body\)"),
        ({"messages": {"phone": (True, 1)}}, UnknownName, "phone"),
        ({"messages": {"radio": (True, 1, "nobody")}}, UnknownName, "nobody"),
        ({"messages": {"radio": (True, 1, np.array([0, 1, 6]))}}, BadValue, "agents from 0 to 5"),
        ({"messages": {"radio": (True, 1j)}}, BadType, "plain value"),
    ],
)
def test_actions_of_another_form_are_refused_before_a_game_is_played(given, kind, message, way):
    with way(given_scene()).batch(2) as games:
        with pytest.raises(kind, match=message):
            games.step({"red": given})
        assert games.turn.tolist() == [0, 0]


def test_deeds_and_messages_from_outside_are_those_that_the_game_declares():
    with scene().batch(2) as games:
        with pytest.raises(BadValue, match=r"Channel 'radio' .* the game has no channels"):
            games.step({"red": {"messages": {"radio": (True, 1)}}})
        with pytest.raises(UnknownName, match=r"Unknown deed, as ctx\.game\.deeds declares none: 'scan'"):
            games.step({"red": {"deeds": {"scan": True}}})
        assert games.turn.tolist() == [0, 0]


@pytest.mark.parametrize("way", WAYS)
def test_actions_of_agents_that_decide_at_arrivals_are_checked(way):
    scenario = scene(settings={"speed_unit": "metres", "decide": "arrival"}).replace(**{"teams.red.speed": 7.0})
    with way(scenario).batch(2) as games:
        games.step({"red": [[1, 1, 0]] * 2})
        assert (games.observe("red")["edge"][:, :, 0] < 0).tolist() == [[False, False, True]] * 2
        with pytest.raises(BadValue, match="action 99 of agent 'red_2' in game 0, turn 1"):
            games.step({"red": [[99, 99, 99]] * 2})
        games.step({"red": [[99, 99, 0]] * 2}, on_illegal="stay")
        assert games.turn.tolist() == [2, 2]


def close_half(ctx):
    """Close every second road."""
    ctx.graph.close_roads([*ctx.graph.graph.get_edges()][::2])


GOING = [({}, {}), ({}, {"speed": 2.0}), ({"speed_unit": "metres"}, {"speed": 25.0}), ({"legal": "any"}, {})]


@pytest.mark.parametrize(("settings", "speed"), GOING)
def test_actions_for_a_later_part_of_a_turn_are_checked_when_deeds_have_closed_roads(settings, speed):
    teams = {name: {"count": 2, "strategy": "gamms.strategies:random_walk", **speed} for name in ("red", "blue")}
    scenario = scene(teams=teams, settings={"order": [["blue"], ["red"]], **settings})
    seen = []
    for way in WAYS:
        with way(scenario).build(seed=1) as ctx:
            ctx.game.add(close_half, phase="deeds")
            with ctx.game.batch(12, seed=3) as games:
                for _ in range(3):
                    counts = games.observe("red").counts
                    games.step({"red": np.arange(12)[:, None] % counts}, on_illegal="stay")
                    seen.append(games.observe("red").node.tolist())
    assert seen[:3] == seen[3:]


@pytest.mark.parametrize(("settings", "speed"), GOING[:3])
def test_actions_that_deeds_have_made_illegal_are_refused_before_the_turn_is_over(settings, speed):
    teams = {name: {"count": 2, "strategy": "gamms.strategies:random_walk", **speed} for name in ("red", "blue")}
    with scene(teams=teams, settings={"order": [["blue"], ["red"]], **settings}).build(seed=1) as ctx:
        ctx.game.add(close_half, phase="deeds")
        with ctx.game.batch(2, seed=3) as games:
            view = games.observe("red")
            last = view.counts - 1
            with pytest.raises(BadValue, match=f"action {last[0, 0]} of agent 'red_0' in game 0, turn 0, is not"):
                games.step({"red": last})
            assert games.turn.tolist() == [0, 0]
            assert games.observe("red").counts.tolist() == view.counts.tolist()


def opening(ctx):
    ctx.game.emit("opened")


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ([[0, 0, 0], [0, 9, 0]], "action 9 of agent 'red_1' in game 1, turn 0"),
        (np.zeros((1, 3), np.int64), "team 'red'"),
        ({"deeds": {"scan": (True, {"node": -2})}}, "there is no node number -2"),
    ],
)
def test_no_rule_is_called_before_actions_are_checked(wrong, message):
    with given_scene().build(seed=2) as ctx:
        ctx.game.add(opening, phase="before")
        with ctx.game.batch(2, seed=2) as games:
            with pytest.raises(BadValue, match=message):
                games.step({"red": wrong})
            assert [games.result(number).events for number in range(2)] == [[], []]
            assert games.turn.tolist() == [0, 0]
            games.step({"red": np.zeros((2, 3), np.int64)})
            assert [[event["kind"] for event in games.result(number).events] for number in range(2)] == [["opened"]] * 2
            assert games.turn.tolist() == [1, 1]


def test_agents_that_are_given_nothing_any_more_follow_their_strategies():
    teams = {name: {"count": 2, "strategy": "gamms.strategies:random_walk"} for name in ("red", "blue")}
    scenario = scene(teams=teams)
    nothing = np.zeros((2, 2), np.int64)
    given = [{"red": nothing}, {"red": nothing}, {}, {"red": nothing, "blue": nothing}, {"blue": nothing}, {}, {}]
    with scenario.batch(2, seed=1) as fast, by_another_plan(scenario).batch(2, seed=1) as slow:
        for actions in given:
            fast.step(actions)
            slow.step(actions)
            for team in ("red", "blue"):
                assert fast.observe(team).node.tolist() == slow.observe(team).node.tolist()
            assert slow.context(0).game.plans == {}

"""Teams that move one after another within a turn."""

import io

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import gamms
from gamms.errors import BadType, BadValue
from gamms.rules import Conflicts, contacts, tag
from gamms.scenario import Scenario


def road(order, *, nodes=10, seed=5):
    ctx = gamms.create_context(seed=seed, logger_config={"level": "ERROR"}, game={"order": order})
    ctx.graph.attach_networkx_graph(gamms.graph.grid(1, nodes))
    return ctx


def player(ctx, name, team, start, *ends, seen=None, **more):
    def strategy(state):
        where = {other: agent.current_node_id for other, agent in ctx.agent.agents.items()}
        if seen is not None:
            seen.append((state["turn"], name, where))
        turn = state["turn"]
        state["action"] = ends[turn] if turn < len(ends) else state["curr_pos"]

    return ctx.agent.create_agent(name, start_node_id=start, team=team, strategy=strategy, **more)


def test_each_team_sees_the_moves_before_its_own():
    seen = []
    with road([["cops"], ["robber"]]) as ctx:
        player(ctx, "a", "robber", 9, 8, 7, seen=seen)
        player(ctx, "b", "cops", 0, 1, 2, seen=seen)
        player(ctx, "c", "cops", 1, 2, 3, seen=seen)
        result = ctx.game.run(2)
        assert result.turns == 2
        assert ctx.game.moves["b"].path == (1, 2)
        assert ctx.agent.get_agent("a").prev_node_id == 8
        assert ctx.agent.get_agent("b").prev_node_id == 1
    assert seen == [
        (0, "b", {"a": 9, "b": 0, "c": 1}),
        (0, "c", {"a": 9, "b": 0, "c": 1}),
        (0, "a", {"a": 9, "b": 1, "c": 2}),
        (1, "b", {"a": 8, "b": 1, "c": 2}),
        (1, "c", {"a": 8, "b": 1, "c": 2}),
        (1, "a", {"a": 8, "b": 2, "c": 3}),
    ]
    assert {name: one["moves"] for name, one in result.agents.items()} == {"a": 2, "b": 2, "c": 2}


def test_agents_on_an_edge_are_on_no_node_while_another_team_moves():
    with road([["cops"], ["robber"]]) as ctx:
        ctx.game.speed_unit, ctx.game.conflicts, tracks = "metres", Conflicts(1), []
        ctx.game.add(lambda ctx: tracks.extend(ctx.game.tracks(ctx.game.agents)), phase="deeds", name="look")
        player(ctx, "cop", "cops", 1, 1, 2, speed=10.0)
        player(ctx, "rob", "robber", 2, 3, 3, speed=4.0)
        result = ctx.game.run(2)
        assert result.agents["cop"]["node"] == 2
        assert result.agents["cop"]["blocked"] == 0
        stands = tracks[-3]  # while the cop moves in the second turn
        assert [leg[3:7] for leg in stands.legs] == [(0.4, 0.4, 0.0, 1.0)]
        assert [leg[3:7] for leg in ctx.game.tracks(ctx.game.agents)[1].legs] == [
            (0.4, 0.4, 0.0, 0.5),
            (0.4, 0.8, 0.5, 1.0),
        ]


def test_an_edge_gone_along_one_after_the_other_is_no_meeting_without_passing():
    with road([["cops"], ["robber"]]) as ctx:
        player(ctx, "cop", "cops", 2, 3)
        player(ctx, "rob", "robber", 3, 2)
        ctx.game.step()
        assert contacts(ctx, "cops", "robber", passing=False) == []
        assert [one.time for one in contacts(ctx, "cops", "robber")] == [0.5]  # on the node, before the robber leaves


def test_agents_that_pass_each_other_in_one_part_of_the_turn_meet_at_its_end_without_passing():
    with road([["cops", "robber"], ["others"]]) as ctx:
        player(ctx, "cop", "cops", 2, 3)
        player(ctx, "rob", "robber", 3, 2)
        player(ctx, "other", "others", 9)
        ctx.game.step()
        (contact,) = contacts(ctx, "cops", "robber", passing=False)
        assert contact[:6] == ("cop", "rob", 0.0, 1.0, 3, 2)


def test_who_is_matched_under_an_order_of_play_does_not_depend_on_how_the_distance_is_given():
    def scores(**form):
        teams = {team: {"count": 2, "strategy": "gamms.strategies:random_walk"} for team in ("red", "blue")}
        sides = [("red", "blue"), ("blue", "red")]
        rules = [{"rule": "tag", "with": {"taggers": a, "tagged": b, "crossing": True, **form}} for a, b in sides]
        settings = {"order": [["red"], ["blue"]]}
        scenario = Scenario(
            map={"grid": {"width": 5, "height": 5}}, teams=teams, rules=rules, settings=settings, max_turns=40
        )
        with scenario.batch(500) as games:
            games.run()
            return [games.result(number).scores for number in range(500)]

    played = scores()
    assert scores(hops=0) == played
    red, blue = (sum(score.get(team, 0) for score in played) for team in ("red", "blue"))
    assert red + blue > 1000
    assert 0.9 < red / blue < 1.1


def test_a_game_that_ends_between_two_teams_asks_no_more():
    with road([["cops"], ["robber"]]) as ctx:
        seen = []
        player(ctx, "cop", "cops", 0, 1)
        player(ctx, "rob", "robber", 5, 6, seen=seen)
        ctx.game.add(lambda ctx: ctx.game.end("enough", winner="cops"), phase="deeds")
        result = ctx.game.run(3)
        assert (result.turns, result.winner, seen, result.agents["cop"]["node"]) == (1, "cops", [], 1)


@pytest.mark.parametrize(
    ("order", "error", "message"),
    [
        (["cops", "robber"], BadType, r"Each item of ctx.game.order must be a list of teams, not 'cops'"),
        ("cops", BadType, "ctx.game.order must be a list of lists of teams"),
        ([["cops"], []], BadValue, "has an empty list: it needs lists of teams"),
        ([], BadValue, "has an empty list"),
        ([["cops"], ["robber", "cops"]], BadValue, "names team 'cops' twice"),
    ],
)
def test_an_order_that_means_nothing_is_refused(order, error, message):
    with road(None) as ctx:
        with pytest.raises(error, match=message):
            ctx.game.order = order
        assert ctx.game.order is None


def test_a_team_that_the_order_leaves_out_is_an_error_before_the_turn():
    with road([["cops"]]) as ctx:
        player(ctx, "cop", "cops", 0, 1)
        player(ctx, "rob", None, 5, 6)
        with pytest.raises(BadValue, match=r"ctx\.game\.order leaves out team None, of which agent 'rob' is"):
            ctx.game.step()
        assert (ctx.game.turn, ctx.agent.get_agent("cop").current_node_id) == (0, 0)
        ctx.game.order = [["cops"], [None]]
        ctx.game.step()
        assert ctx.agent.get_agent("rob").current_node_id == 6


def test_in_a_batch_a_team_without_living_agents_may_be_left_out_of_the_order():
    with road([["cops"], ["robbers"]]) as ctx:
        for name, team in (("cop", "cops"), ("rob", "robbers")):
            ctx.agent.create_agent(name, start_node_id=5, team=team, strategy=gamms.strategies.random_walk)
        ctx.game.step()
        ctx.game.order, ctx.game.max_turns = [["cops"]], 3
        with (
            ctx.game.batch(2) as games,
            pytest.raises(BadValue, match="leaves out team 'robbers', of which agent 'rob'"),
        ):
            games.run()
        ctx.game.eliminate("rob")
        with ctx.game.batch(2) as games:
            games.run()
            assert games.turn.tolist() == [3, 3]


@settings(max_examples=12)
@given(
    teams=st.lists(st.sampled_from("xyz"), min_size=1, max_size=5),
    order=st.permutations([["x"], ["y"], ["z"]]),
    turns=st.integers(1, 4),
    seed=st.integers(0, 99),
)
def test_the_order_of_creation_counts_for_nothing_and_a_recording_goes_on_the_same(teams, order, turns, seed):
    def game(reverse):
        ctx = road(order, nodes=6, seed=seed)
        ctx.game.conflicts = Conflicts(capacity=2)
        for team in "xy":
            ctx.agent.create_team(team, [])  # some games have no agents of a team
        ctx.game.add(tag("x", "y"))
        numbers = range(len(teams))
        for i in reversed(numbers) if reverse else numbers:
            name, start = f"agent {i}", (2 * i + 1) % 6
            ctx.agent.create_agent(name, start_node_id=start, team=teams[i], strategy=gamms.strategies.random_walk)
        return ctx

    file = io.BytesIO()
    with game(reverse=False) as one, game(reverse=True) as other:
        one.record.start(file)
        result = one.game.run(turns + 2)
        one.record.stop()
        assert other.game.run(turns + 2) == result
    with gamms.recorder.open(io.BytesIO(file.getvalue())) as recording, game(reverse=False) as fresh:
        ctx = recording.resume(turns, ctx=fresh)
        assert ctx.game.run(2).events == result.events


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"order": [["cops"], ["robbers"]]}, "item 2 of settings.order.*Did you mean 'robber'"),
        ({"order": [["cops"], ["cops"]]}, r"settings.order.*names team 'cops' twice"),
        ({"order": [[]]}, "settings.order"),
        ({"deeds": {"call": {"whom": "agnt"}}}, r"settings.deeds.*Did you mean 'agent'"),
        ({"deeds": {"call": 3}}, "settings.deeds.call"),
    ],
)
def test_a_scenario_with_an_impossible_order_or_deed_names_the_place(given, message):
    spec = {
        "map": {"grid": {"width": 6, "height": 1}},
        "teams": {"cops": {"count": 1}, "robber": {"count": 1}},
        "settings": given,
    }
    with pytest.raises(gamms.scenario.ScenarioError, match=message):
        gamms.scenario.Scenario(**spec)


@pytest.mark.parametrize("speed", [None, 1.5])
def test_who_is_put_elsewhere_in_its_part_of_the_turn_and_stays_is_there_at_the_end_of_the_turn_alone(speed):
    with road([["cops"], ["robber"]]) as ctx:
        player(ctx, "cop", "cops", 0, 0)
        rob, tracks, parts = player(ctx, "rob", "robber", 9, speed=speed), [], iter([9, 5])
        ctx.game.add(lambda _: setattr(rob, "current_node_id", next(parts)), phase="deeds")
        ctx.game.add(lambda ctx: tracks.extend(ctx.game.tracks([rob])))
        ctx.game.step()
        assert [(track.path, track.times) for track in tracks] == [((5,), (1.0,))]

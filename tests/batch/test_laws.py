"""The law of batches: each game is the game that is played alone, event by event."""

import re
from dataclasses import replace
from math import hypot

import numpy as np
import pytest
from batch_scenes import assert_as_alone, plain
from hypothesis import HealthCheck, Phase, example, given, settings
from hypothesis import strategies as st
from random_games import KINDS, TEAMS, Drawn, games
from random_players import FirstOnly

from gamms.errors import GammsError

LAWS = settings(max_examples=20, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.too_slow])
IN_GAME = re.compile(r"In game (\d+) of a batch")
# Games are too large to be made smaller in reasonable time; from its tenth example on Hypothesis mostly repeats parts.
LARGE = settings(LAWS, max_examples=6, phases=[Phase.generate])


class Outside:
    """Actions that are drawn outside of a batch, and given to it and to the games that are played alone."""

    def __init__(self, drawn, teams, lot):
        self._drawn, self._rng = drawn, np.random.default_rng(lot)
        self.teams = [team for team in teams if team in {team for team, _ in drawn.agents.values()}]
        self._channels = [name for name, one in drawn.channels.items() if "teams" not in one]
        self._taken = {}  # game, turn and agent -> its action and its messages

    def step(self, played):
        """Play a turn in which some teams are given what they do."""
        before = played.turn.tolist()
        played.step({team: self._given(played.observe(team), before) for team in self.teams}, on_illegal="stay")

    def _given(self, view, turns):
        rng, names, shape = self._rng, view["name"], view.node.shape
        moves = rng.integers(0, 1 << 30, shape) % np.maximum(view.counts, 1)
        scans, rows = rng.random(shape) < 0.5, rng.integers(0, 14, shape)
        does = {} if self._drawn.deeds is None else {"deeds": {"scan": (scans, {"node": rows})}}
        says = {name: (rng.random(shape) < 0.5, rows * 100) for name in self._channels}
        flies, flights = [name in self._drawn.flyers for name in names], {}
        if any(flies):
            flights = {"flights": rng.normal(size=(*shape, 3)) * (rng.random((*shape, 1)) < 0.7)}
        nodes = view.streets.columns.node_ids
        for at, agent in np.ndindex(shape):
            do = {"scan": {"node": int(nodes[rows[at, agent]])}} if does and scans[at, agent] else None
            said = [(name, int(rows[at, agent]) * 100) for name, (sends, _) in says.items() if sends[at, agent]]
            legal = view["legal"][at, agent].tolist()[: int(view.counts[at, agent])]
            move = flights["flights"][at, agent].tolist() if flies[agent] else int(moves[at, agent])
            self._taken[at, turns[at], names[agent]] = move, do, said, legal
        return {"moves": moves, **does, **flights, "messages": says} if does or says or flights else moves

    def play_alone(self, alone, number):
        """Play a game with what was given to that of the batch; return its result."""
        self._speeds = {agent.name: agent.speed for agent in alone.agent.create_iter()}
        for team in self.teams:
            alone.game.command(team, lambda states: self._act(number, alone.game.turn, states))
        return alone.game.run()

    def _act(self, number, turn, states):
        for name, state in states.items():
            move, do, said, legal = self._taken[number, turn, name]
            state.get("outbox", []).extend({"channel": name, "to": None, "body": body} for name, body in said)
            if "quat" in state:
                speed = self._speeds[name]
                action = {"direction": move, "distance": min(hypot(*move), speed)}
                state["action"] = action | {"do": do} if do else action
                continue
            if "edge" not in state and not self._drawn.moves_before:
                assert list(state["legal"]) == legal, (name, turn, state["legal"], legal)
            node = state["legal"][move if move < len(state["legal"]) else 0]
            state["action"] = {"node_id": node, "do": do} if do else node


begun_again = st.lists(
    st.tuples(st.integers(0, 4), st.sets(st.integers(0, 3), min_size=1), st.integers(0, 3)), max_size=2
)
given_to = st.one_of(st.just([]), st.lists(st.sampled_from(TEAMS), min_size=1, unique=True))


drawn_for_all = {
    "seeds": st.lists(st.integers(0, 2**62), min_size=1, max_size=4),
    "again": begun_again,
    "outside": given_to,
    "lot": st.integers(0, 99),
}


@pytest.mark.parametrize("how", [("one edge", "anywhere"), ("edges",), ("metres",), ("metres, at arrivals",)])
@LARGE
@given(data=st.data(), **drawn_for_all)
def test_a_game_of_a_batch_is_the_game_that_is_played_alone(how, data, seeds, again, outside, lot):
    drawn = data.draw(games(how))
    with drawn.open() as ctx:
        check_games(ctx, drawn, seeds, again, Outside(drawn, outside, lot))


modes = st.lists(st.sampled_from(["car", "foot", None]), min_size=1, max_size=3).filter(any)


@pytest.mark.parametrize("how", ["one edge", "edges", "metres", "metres, at arrivals"])
@settings(LARGE, max_examples=4)
@given(data=st.data(), modes=modes, **drawn_for_all)
def test_games_in_which_agents_have_modes_are_those_that_are_played_alone(how, data, modes, seeds, again, outside, lot):
    drawn = replace(data.draw(st.one_of(games([how]), games_with_plain_parts([how]))), modes=modes)
    outside = without_recruits(drawn, outside)
    with drawn.open() as ctx:
        check_games(ctx, drawn, seeds, again, Outside(drawn, outside, lot))


@LARGE
@given(drawn=games(in_air=True), **drawn_for_all)
def test_games_in_which_agents_fly_are_those_that_are_played_alone(drawn, seeds, again, outside, lot):
    with drawn.open() as ctx:
        check_games(ctx, drawn, seeds, again, Outside(drawn, outside, lot))


@settings(LARGE, max_examples=8)
@given(drawn=games(), turns=st.integers(1, 6), **drawn_for_all)
def test_a_batch_of_a_game_that_has_begun_goes_on_as_the_game_alone(drawn, turns, seeds, again, outside, lot):
    with drawn.open() as ctx:
        ctx.game.on_illegal = "stay"
        for _ in range(min(turns, drawn.max_turns - 1)):
            ctx.game.step()
        ctx.game.on_illegal = drawn.on_illegal
        living = {agent.team for agent in ctx.game.agents}
        ctx.game.order = [left for part in ctx.game.order or () if (left := [*living.intersection(part)])] or None
        check_games(ctx, drawn, seeds, again, Outside(drawn, outside, lot))


@settings(LARGE, max_examples=2)
@given(drawn=st.one_of(games(), games(), games(in_air=True)), lot=st.integers(0, 2**32))
def test_a_game_is_the_same_among_fifty_others_by_itself_and_in_another_order(drawn, lot):
    drawn = replace(drawn, asked="", called=(), collected=())  # plain functions take their time in many games
    rng = np.random.default_rng(lot)
    seeds, few = rng.integers(0, 2**62, 50).tolist(), rng.choice(50, 5, replace=False).tolist()
    with drawn.open() as ctx, ctx.game.batch(seeds=seeds) as many:
        try:
            many.run()
        except GammsError as error:
            number = int(IN_GAME.search(" ".join(error.__notes__))[1])
            with ctx.game.batch(seeds=[seeds[number]]) as one, pytest.raises(type(error), match=re.escape(str(error))):
                one.run()
            return
        with ctx.game.batch(seeds=[seeds[number] for number in few]) as some, ctx.game.batch(1) as one:
            some.run()
            for place, number in enumerate(few):
                one.reset(seeds=[seeds[number]])
                one.run()
                assert plain(one.result(0)) == plain(some.result(place)) == plain(many.result(number))


@st.composite
def games_with_plain_parts(draw, how=("one edge", "anywhere", "edges", "metres", "metres, at arrivals")):
    """A random game with one context that is pointed at its games."""
    drawn = draw(games(how))
    kinds = st.lists(st.integers(0, len(KINDS) - 1), min_size=1, max_size=3, unique=True)
    called = st.tuples(
        st.sampled_from(
            [
                "look",
                "meet",
                "push",
                "purge",
                "toll",
                "dig",
                "refuses",
                "recruit",
                "alter",
                "desert",
                "recall",
                "recall",
            ]
        ),
        st.sampled_from(["before", "deeds", "after"]),
    )
    return replace(
        drawn,
        reserved={},
        conflicts=draw(st.sampled_from([drawn.conflicts, FirstOnly()])),
        eyes=draw(st.lists(kinds, min_size=1, max_size=3)),
        asked=draw(st.sampled_from(["a", "bc", "abc", "p", "bcw", "abcw"])),
        called=draw(st.lists(called, max_size=3)),
    )


@settings(LAWS, max_examples=8)
@given(drawn=games_with_plain_parts(), **drawn_for_all)
def test_games_in_which_plain_functions_are_called_are_those_that_are_played_alone(drawn, seeds, again, outside, lot):
    outside = without_recruits(drawn, outside)
    with drawn.open() as ctx:
        check_games(ctx, drawn, seeds, again, Outside(drawn, outside, lot))


def make_crowd():
    """Return a game whose agents are blocked often, and that leaves its batch in its first turn."""
    pairs = [(a, b) for a in range(14) for b in (a + 1, a + 6, a + 7) if b < 14]
    return Drawn(
        agents={"a0": ("red", 17), "b1": ("red", 5), "c2": ("red", 17)},
        streets=[(*way, 0.5) for a, b in pairs for way in ((a, b), (b, a))],
        conflicts=FirstOnly(),
        called=[("look", "before"), ("recruit", "before")],
        asked="bcw",
        eyes=[[0]],
        reserved={},
        has_checks=False,
    )


@settings(LAWS, max_examples=8)
@given(drawn=games_with_plain_parts(), turns=st.integers(1, 6), **drawn_for_all)
@example(drawn=make_crowd(), turns=6, seeds=[0], again=[], outside=[], lot=0)
def test_games_that_have_begun_in_which_plain_functions_are_called_go_on_as_alone(
    drawn, turns, seeds, again, outside, lot
):
    outside = without_recruits(drawn, outside)
    with drawn.open() as ctx:
        ctx.game.on_illegal = "stay"
        for _ in range(min(turns, drawn.max_turns - 1)):
            ctx.game.step()
        ctx.game.on_illegal = drawn.on_illegal
        check_games(ctx, drawn, seeds, again, Outside(drawn, outside, lot))


@settings(LAWS, max_examples=6)
@given(drawn=st.one_of(games_with_plain_parts(), games()), turns=st.integers(1, 5), number=st.integers(0, 2))
def test_the_context_of_a_game_is_the_game_and_plays_on_as_its_batch(drawn, turns, number):
    outside = Outside(drawn, without_recruits(drawn, ["red"]), 3)
    with drawn.open() as ctx, ctx.game.batch(seeds=[3, 8, 9]) as played:
        ctx.game.on_illegal = "stay"
        for _ in range(turns):
            outside.step(played)
        shown = played.context(number)
        assert repr(plain(shown.game.result())) == repr(plain(played.result(number)))
        outside.step(played)
        played.run()
        assert repr(plain(shown.game.result())) == repr(plain(played.result(number)))


def without_recruits(drawn, outside):
    """Return the teams that are given actions: none where agents come that are given none, as there are no rows."""
    return [] if any(name == "recruit" for name, _ in drawn.called) else outside


def check_games(ctx, drawn, seeds, again, from_outside):
    """Check that the games of a batch of a game are those that are played alone."""
    reserved = {team: [one for one in names if one not in ctx.agent.agents] for team, names in drawn.reserved.items()}
    with ctx.game.batch(seeds=seeds, most_agents=reserved) as played, ctx.game.fork(0).ctx as alone:
        try:
            play(played, again, from_outside)
        except GammsError as error:
            check_error(error, played, alone, from_outside)
            return
        for number, seed in enumerate(played.seeds):
            alone.game.reset(seed=seed)
            assert repr(plain(played.result(number))) == repr(plain(from_outside.play_alone(alone, number)))


def play(played, again, from_outside):
    """Play a batch to its end; some games begin again after some turns."""
    for turns, which, other in again:
        for _ in range(turns):
            from_outside.step(played)
        those = sorted({number % len(played) for number in which})
        played.reset(those, seeds=[played.seeds[number] + other for number in those])
    while from_outside.teams and not played.is_over.all():
        from_outside.step(played)
    played.run()


def check_error(error, played, alone, from_outside):
    """Check that the game that an error names raises the same when it is played alone, in the same turn."""
    number = int(IN_GAME.search(" ".join(error.__notes__))[1])
    alone.game.reset(seed=played.seeds[number])
    with pytest.raises(type(error)) as raised:
        from_outside.play_alone(alone, number)
    assert str(raised.value) == str(error)
    assert alone.game.turn == played.turn[number]


def test_agents_that_are_put_back_while_on_an_edge_stay_there():
    streets = [way for i in range(13) for way in ((i, i + 1, 1.1), (i + 1, i, 1.1))]
    agents, motion = {"a0": ("red", 5), "b1": ("blue", 20)}, {"speed_unit": "metres", "speeds": [0.3]}
    with (
        Drawn(agents, streets, motion=motion, deeds=["deeds"]).open() as ctx,
        ctx.game.batch(8) as played,
        ctx.game.fork(0).ctx as alone,
    ):
        played.run()
        assert any(event["kind"] == "respawned" for event in played.result(0).events)
        assert_as_alone(played, alone)

"""Whatever an enemy writes into what rules and strategies store: a game goes on from it, or ends in an error."""

import io
import secrets
from functools import cache

import numpy as np
import pytest
from tampering import GAMES, Builder, RecordedGame, fuzz, go_on

import gamms
from gamms import rules, strategies
from gamms.errors import TooLarge
from gamms.recorder import RecordingError

recorded = cache(RecordedGame)


ALONE = {"robots": ["built"], "flags_by_metres": ["built", "batch"]}  # others also go on in other ways
WAYS = [(name, how) for name in GAMES for how in ALONE.get(name, ["built", "fresh", "batch"])]


@pytest.mark.parametrize(("name", "how"), WAYS)
def test_every_game_itself_goes_on(name, how):
    game = recorded(GAMES[name])
    go_on(game, game.written(game.begin), how)


@pytest.mark.parametrize("name", GAMES)
def test_tampered_games_go_on_or_end_in_errors(name):
    fuzz(name, secrets.token_hex(4), 30)


@pytest.mark.parametrize(
    ("name", "seed", "count"), [("tags", "a", 20), ("flags", "a", 20), ("places", "a", 20), ("beliefs", "a", 20)]
)
def test_tampered_games_of_one_seed_go_on_or_end_in_errors(name, seed, count):
    fuzz(name, seed, count)


WRONG = [
    (
        "places",
        ("starts", "red0"),
        (1.0, 2.0, 3.0),
        r"start of agent 'red0' must be a node, or \(x, y, z\) if it flies",
    ),
    ("arrays", ("data", "array functions"), {"storm": {"level": 3}}, "must be an array of one game, not 3"),
    ("cars", ("driven", "red0"), 5, "must be lists of ids by name, not {'red0': 5"),
    ("cars", ("driven", "red0"), ["a"], "must be lists of ids by name, not {'red0': "),
    ("cars", ("named_edges", "blue0"), (1, "a"), "must be a dict of pairs of a turn and an edge, not "),
    ("cars", ("named_edges", "blue0"), (1, 1 << 63), "must be a dict of pairs of a turn and an edge, not "),
    ("cars", ("driven", "red0"), [-(1 << 70)], "must be lists of ids by name, not "),
    ("tags", ("scores",), [("red", 10**400)], "The score of 'red' must fit into a float"),
    ("tags", ("turn",), 1 << 62, "The number of turns must be an integer from 0 to"),
    ("tags", ("turn",), -3, "The number of turns must be an integer from 0 to"),
]


@pytest.mark.parametrize(("name", "path", "value", "message"), WRONG, ids=lambda one: str(one)[:40])
def test_resume_names_the_error_in_the_stored_values(name, path, value, message):
    game = recorded(GAMES[name])
    data = game.changed(path, value)
    assert data != game.written(game.begin)
    with pytest.raises(RecordingError, match=message) as caught:
        go_on(game, data, "built")
    assert "turn 0" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_number_of_blockades_in_a_memory_costs_no_more_than_eight():
    game = recorded(GAMES["flags"])
    counters = {"blocked": 99, "calm": 0, "often": 1 << 40, "yield": 0, "ahead": None}
    go_on(game, game.changed(("memories", "blue2", "unblock"), counters), "built")


@pytest.mark.parametrize("turn", [1 << 40, 100_001])
def test_a_belief_refuses_to_follow_more_turns_than_a_game_can_have(turn):
    game = recorded(GAMES["beliefs"])
    with pytest.raises(TooLarge, match=f"at most 100,000, and this is turn {turn:,}"):
        go_on(game, game.changed(("turn",), turn), "built")


def test_edges_that_do_not_follow_each_other_do_not_count_as_driven():
    game = recorded(GAMES["cars"])
    last = game.begin["driven"]["red0"][-1]
    for edges in ([last, last], [9999, last], [9999], [*range(60), last]):
        data = game.changed(("driven", "red0"), edges)
        with game.build() as ctx, gamms.recorder.open(io.BytesIO(data)) as recording:
            recording.resume(0, ctx=ctx)
            driven = ctx.game.internals.parts.turns.legality.find_driven("red0")
            assert driven == ((last,) if last in edges else ())
            ctx.game.step()
            assert not ctx.game.errors


def walkers(ctx=None):
    make = Builder(ctx, speed_unit="metres")
    make.team("red", *[strategies.goto(make.ctx, 24)] * 3, speed=7.0)
    return make.rules(rules.time_limit(30))


def test_a_batch_keeps_agents_on_their_edges_also_at_turn_0():
    game = RecordedGame(walkers)
    with game.build() as ctx, gamms.recorder.open(io.BytesIO(game.changed(("turn",), 0))) as recording:
        recording.resume(0, ctx=ctx)
        nodes = np.array([agent.current_node_id for _, agent in sorted(ctx.agent.agents.items())])
        with ctx.game.batch(1) as games:
            is_on_edge = games.columns()["edge"][0] >= 0
            ids = ctx.graph.columns().node_ids[games.columns()["node"][0]]
            assert is_on_edge.any()
            assert ids[is_on_edge].tolist() == nodes[is_on_edge].tolist()
            games.step()


def test_a_context_is_unchanged_after_a_recording_that_does_not_fit_it():
    game = recorded(GAMES["tags"])
    data = game.changed(("turn",), -3)
    with game.build() as ctx:
        ctx.game.run(2)
        before = ctx.game.data, ctx.game.turn, [agent.current_node_id for agent in ctx.game.agents]
        with gamms.recorder.open(io.BytesIO(data)) as recording, pytest.raises(RecordingError):
            recording.resume(0, ctx=ctx)
        assert (ctx.game.data, ctx.game.turn, [agent.current_node_id for agent in ctx.game.agents]) == before

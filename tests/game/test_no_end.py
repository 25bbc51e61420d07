"""A game that nothing limits is warned about once, alone and in a batch."""

import networkx as nx
import pytest

import gamms
from gamms.game import batch
from gamms.game import game as game_module
from gamms.game.plan import find_first_called
from gamms.game.result import MANY_TURNS
from gamms.rules import last_team, reach, time_limit
from gamms.strategies import random_walk, stay

SAID = (
    f"After {MANY_TURNS:,} turns no rule has ended the game, and nothing limits its turns: it may never end. Give "
    "run(max_turns=…), or set max_turns of the game or scenario."
)


def end_late(ctx):
    """End the game long after the warning."""
    if ctx.game.turn == 200:
        ctx.game.end("late")


@pytest.fixture
def game(ctx, monkeypatch):
    """A game of two teams; the warning comes after 50 turns."""
    monkeypatch.setattr(game_module, "MANY_TURNS", 50)
    monkeypatch.setattr(batch, "MANY_TURNS", 50)
    ctx.graph.attach_networkx_graph(gamms.graph.grid(2, 2))
    for name, team in (("ann", "red"), ("bob", "blue")):
        ctx.agent.create_agent(name, start_node_id=0, team=team, strategy=stay)
    return ctx.game


@pytest.fixture
def ctx():
    with gamms.create_context(seed=1) as ctx:
        yield ctx


def test_the_warning_names_max_turns_and_comes_once(game, heard):
    game.add(end_late)
    result = game.run()
    assert (result.turns, heard) == (200, [SAID])


@pytest.mark.parametrize("limit", ["run", "setting", "rule"])
def test_a_game_with_a_limit_is_not_warned_about(game, heard, limit):
    game.add(end_late)
    game.max_turns = 150 if limit == "setting" else None
    if limit == "rule":
        game.add(time_limit(150))
    game.run(150 if limit == "run" else None)
    assert (game.turn, heard) == (150, [])


def test_turns_of_earlier_runs_do_not_count(game, heard):
    game.add(last_team())
    for _ in range(3):
        game.run(40)
    game.add(end_late)
    game.run()
    assert heard == [SAID]


def test_a_batch_is_warned_about_once(game, heard):
    game.add(end_late)
    with game.batch(3) as games:
        games.run()
        assert games.turn.tolist() == [200] * 3
        assert [text for text in heard_by(games) if "After" in text] == [SAID]


def test_a_batch_in_the_core_is_warned_about_too(game, heard):
    game.ctx.agent.create_agent("walker", start_node_id=3, team="green", strategy=random_walk)
    game.ctx.graph.attach_networkx_graph(nx.path_graph(range(4, 40)))
    game.ctx.graph.add_edges([900, 901], [3, 4], [4, 3], [1.0, 1.0])
    game.add(reach("green", 39))
    with game.batch(2) as games:
        games.run()
        assert find_first_called(games.game, games.roster) is None
        assert min(games.turn) > 100
        assert [text for text in heard_by(games) if "After" in text] == [SAID]


def test_a_batch_with_a_limit_is_not_warned_about(game, heard):
    game.add(time_limit(120))
    with game.batch(3) as games:
        games.run()
        assert [text for text in heard_by(games) if "After" in text] == []


def heard_by(games):
    """Return the warnings of the context of a batch, which a fork shares with its game."""
    return games.game.ctx.logger.warnings

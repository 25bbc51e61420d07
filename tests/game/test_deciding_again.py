"""The core decides for shipped strategies again soon after a reset or a restored snapshot, however old the game was."""

import pytest

import gamms
from gamms.knowledge.sides import PastViews, Side
from gamms.strategies import random_walk

AGENTS = 100
MOST = 20  # turns in which Python is asked after the states of a turn were read


def open_game():
    ctx = gamms.create_context(seed=1)
    ctx.graph.attach_networkx_graph(gamms.graph.grid(10, 10))
    for i in range(AGENTS):
        ctx.agent.create_agent(f"a{i}", start_node_id=i, team="red" if i % 2 else "blue", strategy=random_walk)
    return ctx.game


def count_asked(game, turns):
    """Play turns; return in how many of them Python was asked."""
    engine = game.internals.parts.turns
    before = engine.asked
    for _ in range(turns):
        game.step()
    return engine.asked - before


def read_state(game):
    game.ctx.agent.get_agent("a0").get_state()


@pytest.mark.parametrize("read", [read_state, lambda game: game.run(10), lambda game: game.snapshot()])
def test_the_core_decides_soon_after_a_reset_of_an_old_game_whose_states_were_read(read):
    game = open_game()
    count_asked(game, 60)
    read(game)
    for seed in (2, 3):
        game.reset(seed=seed)
        assert count_asked(game, 50) <= MOST


def test_the_core_decides_at_once_in_an_episode_after_one_in_which_it_decided():
    game = open_game()
    count_asked(game, 60)
    read_state(game)
    game.reset(seed=2)
    count_asked(game, 50)
    game.reset(seed=3)
    assert count_asked(game, 30) == 0


def test_the_core_decides_soon_after_a_restored_snapshot_of_a_young_game():
    game = open_game()
    count_asked(game, 5)
    young = game.snapshot()
    count_asked(game, 60)
    read_state(game)
    game.restore(young)
    assert count_asked(game, 50) <= MOST


def test_what_a_side_saw_before_a_reset_tells_nothing_of_the_next_game():
    red, blue = Side("red", None), Side("blue", None)
    views = PastViews()
    views.note(5, red, ["b"])
    views.note(0, blue, [])
    event = {"turn": 5, "kind": "flag", "agent": "b"}
    assert views.find_witnesses(event, {"a": red, "b": blue}) == {blue}

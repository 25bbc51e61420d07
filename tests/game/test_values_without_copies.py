"""Values in memories and data that cannot be copied: copies of the game leave them out, and say so."""

import copy
import sys
import threading
import warnings

import pytest

import gamms


class NeverCopied:
    def __deepcopy__(self, memo):
        raise ValueError("never")


def count_up():
    yield from range(100)


MAKERS = {
    "generator": count_up,
    "lock": threading.Lock,
    "file": lambda: sys.__stderr__,
    "object": NeverCopied,
}


def open_game(make):
    ctx = gamms.create_context(seed=1, logger_config={"level": "CRITICAL"})
    ctx.graph.attach_networkx_graph(gamms.graph.grid(3, 3))

    def keep(values):
        if "odd" not in values:
            values["odd"] = {"inside": [make()]}
        values["turns"] = values.get("turns", 0) + 1

    def plan(state):
        keep(state["memory"])
        state["action"] = state["legal"][-1]

    ctx.agent.create_agent("ann", start_node_id=0, strategy=plan)
    ctx.game.add(lambda ctx: keep(ctx.game.data))
    ctx.game.max_turns = 9
    ctx.game.run(2)
    return ctx.game


def play_batch(game):
    with game.batch(2) as games:
        games.run()
        assert games.turn.tolist() == [9, 9]
        assert games.context(0).game.turn == 9


def play_fork(game):
    ahead = game.fork(1)
    assert ahead.data == {"turns": 2}
    ahead.run(2)
    assert ahead.data["turns"] == 4
    assert "inside" in ahead.data["odd"]


OPERATIONS = {
    "snapshot": lambda game: game.restore(game.snapshot()),
    "fork": play_fork,
    "copy": lambda game: copy.deepcopy(game.ctx).game.run(1),
    "batch": play_batch,
}


@pytest.mark.parametrize("operation", OPERATIONS)
@pytest.mark.parametrize("kind", MAKERS)
def test_copies_of_a_game_leave_out_what_cannot_be_copied_and_name_owner_and_key(kind, operation):
    game = open_game(MAKERS[kind])
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("default")
        OPERATIONS[operation](game)
    texts = {str(one.message).partition(",")[0] for one in said}
    assert texts == {"the memory of agent 'ann' has 'odd'", "ctx.game.data has 'odd'"}


def test_a_restored_game_goes_on_without_the_generator_and_its_snapshot_has_the_rest():
    game = open_game(count_up)
    with pytest.warns(UserWarning, match="'odd', which cannot be copied"):
        saved = game.snapshot()
    assert saved.data == {"turns": 2}
    game.run(2)
    game.restore(saved)
    assert game.data == {"turns": 2}
    game.run(1)
    assert game.data["turns"] == 3


def test_values_that_hold_the_same_object_still_do_in_a_copy_without_others():
    game = open_game(count_up)
    game.data["both"] = game.data["too"] = [1]
    with pytest.warns(UserWarning, match="'odd', which cannot be copied"):
        ahead = game.fork(1).ctx.game
    assert ahead.data["both"] is ahead.data["too"] is not game.data["both"]

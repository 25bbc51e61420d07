"""What a game leaves to the garbage collector when its context is over and no program holds it."""

import gc

from hypothesis import given, settings
from hypothesis import strategies as st

from gamms import core
from gamms.game.snapshots import GameStart
from gamms.scenario import Scenario

TEAMS = {name: {"count": 3, "strategy": "gamms.strategies:random_walk"} for name in ("red", "blue")}


def garbage_of(turns):
    """Return how many objects of a game that was played are found by the garbage collector alone."""
    game = Scenario(map={"grid": {"width": 4, "height": 4}}, teams=TEAMS, max_turns=turns)
    game.play(seed=1)
    gc.disable()
    gc.freeze()
    try:
        game.play(seed=2)
        return gc.collect()
    finally:
        gc.unfreeze()
        gc.enable()


def test_turns_that_were_played_leave_no_garbage():
    few, many, most = garbage_of(5), garbage_of(105), garbage_of(1005)  # the last two are played in the core
    assert many < few + (125 if core.is_compiled else 270)  # what the core keeps of a game, once
    assert most <= many + 10
    assert most < (540 if core.is_compiled else 720)


def live_starts():
    """Return how many starts of games are alive."""
    gc.collect()
    return sum(type(one) is GameStart for one in gc.get_objects())


START_AGAIN = {
    "reset": lambda ctx: ctx.game.reset(),
    "another seed": lambda ctx: ctx.game.reset(seed=ctx.seed + 1),
    "restore": lambda ctx: ctx.game.restore(ctx.game.snapshot()),
    "fork": lambda ctx: ctx.game.fork(0).ctx.terminate(),
    "an agent more": lambda ctx: (
        ctx.game.reset(),
        ctx.agent.create_agent(f"more {len(ctx.agent.agents)}", start_node_id=0),
    ),
}


@settings(max_examples=10, deadline=None)
@given(st.lists(st.tuples(st.integers(0, 2), st.sampled_from(sorted(START_AGAIN))), min_size=3, max_size=12))
def test_no_more_than_two_starts_of_games_are_alive(played):
    gc.freeze()  # what other tests have left is neither searched nor counted
    try:
        play_again_and_again(played)
    finally:
        gc.unfreeze()


def play_again_and_again(played):
    game = Scenario(map={"grid": {"width": 4, "height": 4}}, teams=TEAMS, max_turns=5)
    with game.build(seed=1) as ctx:
        for turns, again in played:
            for _ in range(turns):
                ctx.game.step()
            START_AGAIN[again](ctx)
        assert live_starts() <= 2

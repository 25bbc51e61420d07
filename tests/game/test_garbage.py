"""What a game leaves to the garbage collector when its context is over and no program holds it."""

import gc

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
    few, many = garbage_of(5), garbage_of(105)
    assert many <= few + 10
    assert many < 500

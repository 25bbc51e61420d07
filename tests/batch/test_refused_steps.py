"""A batch whose first step was refused says the same again."""

import pytest

from gamms.errors import BadValue
from gamms.rules import Conflicts
from gamms.scenario import Scenario


def go_last(state):
    state["action"] = state["legal"][-1]


def test_a_batch_whose_first_step_is_refused_says_the_same_sentence_again():
    settings = {"speed_unit": "metres", "decide": "arrival"}
    teams = {"red": {"count": 2, "speed": 33.0}}
    game = Scenario(map={"grid": {"rows": 4, "columns": 4}}, max_turns=9, settings=settings, teams=teams)
    ctx = game.build(seed=1, strategies={"red": go_last})
    ctx.game.conflicts = Conflicts(capacity=1, allow_swaps=False)
    with ctx.game.batch(2) as games:
        for _ in range(3):
            with pytest.raises(BadValue, match=r"allow_swaps=False\) counts nothing"):
                games.step()
            assert games.turn.tolist() == [0, 0]


def test_a_game_whose_first_turn_is_refused_says_the_same_again_and_plays_when_the_cause_is_gone():
    settings = {"speed_unit": "metres", "decide": "arrival"}
    teams = {"red": {"count": 2, "speed": 33.0}}
    game = Scenario(map={"grid": {"rows": 4, "columns": 4}}, max_turns=9, settings=settings, teams=teams)
    ctx = game.build(seed=1, strategies={"red": go_last})
    ctx.game.conflicts = Conflicts(capacity=1, allow_swaps=False)
    for play in (ctx.game.step, ctx.game.run, ctx.game.step, ctx.game.run):
        with pytest.raises(BadValue, match=r"allow_swaps=False\) counts nothing"):
            play()
    ctx.game.conflicts = None
    assert ctx.game.run().turns == 9

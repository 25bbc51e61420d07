"""The law of batches of many games in which agents come and go and functions raise: each is the game played alone."""

import os

import pytest
from random_lives import find_difference, make_game

IS_THOROUGH = os.environ.get("GAMMS_THOROUGH") == "1"
IS_BRIEF = os.environ.get("GAMMS_BRIEF") == "1"
SEEDS = range(400) if IS_THOROUGH else (7, 15, 19, 46, 72, 104, 2013, 3444)[: 2 if IS_BRIEF else 8]


@pytest.mark.law
@pytest.mark.parametrize("seed", SEEDS)
def test_a_game_in_which_agents_come_and_go_is_the_same_among_many_others(seed):
    game = make_game(seed)
    with game.ctx:
        assert find_difference(game) == ""

"""Whatever an enemy writes into a recording: using it raises RecordingError, or works."""

import random
import secrets

import pytest
from fuzzing_games import drawn_game, fuzz_games, game, look, mutant, use


def test_the_game_itself_can_be_used():
    use(game())


@pytest.mark.parametrize("is_declared", [False, True])
def test_the_drawn_game_itself_can_be_looked_at(is_declared):
    look(drawn_game(is_declared=is_declared))


def test_mutated_games_end_in_recording_errors_or_work():
    fuzz_games(secrets.token_hex(4), 4)


@pytest.mark.parametrize(
    "name",
    [
        "11200c02/367",
        "q/908",
        "q/1115",
        "r/337",
        "r/489",
        "r/655",
        "r/892",
        "s/2086",
        "s/2425",
        "final/1369",
        "nov20/2206",
        "9488d3be/924",
        "1f06facb/266",
    ],
)
def test_mutants_that_once_did_harm_do_none(name):
    use(mutant(game(), random.Random(name)))

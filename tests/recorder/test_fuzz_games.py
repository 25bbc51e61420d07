"""Whatever an enemy writes into a recording: using it raises RecordingError, or works."""

import secrets

import pytest
from fuzzing_games import fuzz_games, game, use


def test_the_game_itself_can_be_used():
    use(game())


def test_mutated_games_end_in_recording_errors_or_work():
    fuzz_games(secrets.token_hex(4), 50)


@pytest.mark.parametrize("seed", ["a", "b"])
def test_mutants_that_failed_once(seed):
    fuzz_games(seed, 10)

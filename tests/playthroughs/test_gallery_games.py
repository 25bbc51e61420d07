"""The games of the gallery are played as their golden texts say.

A failure is a change of what a game means, or of how it is written: `GAMMS_REFRESH_EXAMPLES=1` writes the texts again,
and `git diff` shows what has changed.
"""

import os

import pytest
from gallery_turns import GAMES, GOLDEN

from gamms import scenario
from gamms.testing import playthrough


def write_game(name):
    turns = GAMES[name]
    with scenario.from_gallery(name).build() as ctx:
        text = playthrough(ctx, turns.first, turns.names)
        ctx.game.run(turns.later - ctx.game.turn)
        return f"{text}\n{playthrough(ctx, turns.more, turns.names)}"


def test_all_games_that_need_no_server_have_a_text():
    assert {*GAMES} == {*scenario.gallery()} - {"language_model"}
    assert {file.stem for file in GOLDEN.iterdir()} == {*GAMES}


@pytest.mark.parametrize("name", GAMES)
def test_a_game_is_played_as_its_text_says(name):
    text = write_game(name)
    file = GOLDEN / f"{name}.txt"
    if os.environ.get("GAMMS_REFRESH_EXAMPLES") == "1":
        file.write_text(text, encoding="utf-8")
    assert text == file.read_text(encoding="utf-8")

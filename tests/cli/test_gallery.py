"""`gamms gallery`: the games that come with GAMMS."""

import json
import os
import re
import sys
from html import escape
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from threading import Thread

import pytest
from PIL import Image
from typer.testing import CliRunner

from gamms import cli, scenario
from gamms.cli.gallery import describe_game, list_statistics
from gamms.visual.constants import Layer

sys.path.insert(0, str(Path(__file__).parents[2] / "scripts"))
from gallery_results import measured

GAMES = {name: scenario.from_gallery(name) for name in scenario.gallery()}
RESULTS = next(iter(scenario.gallery().values())).with_name("results.json")


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def run(*arguments):
    return CliRunner().invoke(cli.app, list(map(str, arguments)), catch_exceptions=False)


def test_the_list_says_a_line_of_each_game():
    shown = " ".join(run("gallery").stdout.split())
    assert len(GAMES) >= 12
    assert "Play one: gamms gallery patrol Change one: gamms new mine --from patrol" in shown
    for name, game in GAMES.items():
        assert f"{name} {game.spec.description}" in shown


@pytest.mark.parametrize("name", GAMES)
def test_a_game_states_its_model_and_is_at_most_a_page_of_code(name):
    game = GAMES[name]
    assert len(describe_game(game)) >= 2
    assert re.search(r"\b(19|20)\d\d\b", describe_game(game)[0]), "name what it is near to in the literature"
    files = {found.file for found in game.code() if found.file is not None}
    assert all(len([line for line in file.read_text().splitlines() if line]) <= 66 for file in files)


@pytest.mark.parametrize("name", GAMES)
def test_a_game_paints_nothing_over_its_agents(name):
    with GAMES[name].build(1) as ctx:
        drawn = {name: one.get_layer() for name, one in ctx.visual.artists.declared.items()}
    beside = {key: layer for key, layer in drawn.items() if layer >= Layer.AGENTS}
    assert set(beside.values()) <= {Layer.FLAGS}, "signs beside agents, and what they carry"
    assert not any(key.startswith("rule_") for key in beside), beside


@pytest.mark.parametrize("name", GAMES)
def test_both_sides_win_games_or_there_are_no_sides(name):
    found = list_statistics()[name]
    assert found.games >= 100
    assert sum(won for won, _, _ in found.wins.values()) == (0 if found.scores else found.games)
    assert all(low < mean < high for mean, low, high in found.scores.values())
    assert all(5 <= won <= 95 and low < won / found.games < high for won, low, high in found.wins.values())


def test_a_game_is_played_into_a_folder(folder):
    done = run("gallery", "people_and_machines", "--seed", 5, "--out", "played")
    assert done.exit_code == 0
    assert {path.name for path in (folder / "played").iterdir()} == {"game.html", "result.json", "game.ggr"}
    assert json.loads((folder / "played/result.json").read_text())["seed"] == 5
    assert done.stdout.index("game.html") < done.stdout.index("result.json")
    assert "<title>People and machines" in (folder / "played/game.html").read_text()


def test_a_page_has_a_picture_that_opens_the_replay(folder):
    assert run("gallery", "people_and_machines", "--page", "games").exit_code == 0
    page = (folder / "games/index.html").read_text()
    assert '<a href="people_and_machines.html"><picture>' in page
    assert 'media="(prefers-color-scheme: dark)" srcset="people_and_machines_dark.png"' in page
    assert '<img src="people_and_machines.png"' in page
    assert GAMES["people_and_machines"].spec.description in page
    assert f"By the baselines: {escape(str(list_statistics()['people_and_machines']))}." in page
    assert "http" not in page, "it is for reading offline"
    assert (folder / "games/people_and_machines.png").stat().st_size < 60_000
    corners = []
    for file in ("people_and_machines.png", "people_and_machines_dark.png"):
        with Image.open(folder / "games" / file) as still:
            assert still.width * 3 == still.height * 4
            corners.append(sum(still.convert("RGB").getpixel((1, 1))))
    assert corners[0] > 600 > 200 > corners[1]
    assert (folder / "games/people_and_machines.html").stat().st_size > 100_000


def test_a_page_leaves_out_a_game_whose_library_is_missing(folder, monkeypatch):
    chosen = {name: file for name, file in scenario.gallery().items() if name in {"language_model", "perimeter"}}
    monkeypatch.setattr(scenario, "gallery", lambda: chosen)
    monkeypatch.setitem(sys.modules, "openai", None)
    done = run("gallery", "--page", "games")
    assert done.exit_code == 0
    assert "Left out: language_model. Asking a language model needs an optional library (extra 'llm')" in done.stderr
    assert {path.name for path in folder.glob("games/*")} == {
        "index.html",
        "perimeter.html",
        "perimeter.png",
        "perimeter_dark.png",
    }
    assert run("gallery", "language_model", "--page", "one").exit_code == 1


def test_the_gallery_refuses_unknown_games_and_a_missing_name():
    assert "Unknown game 'patrl'. Did you mean 'patrol'?" in run("gallery", "patrl").stderr
    assert "needs the name of a game" in run("gallery", "--seed", 3).stderr


class Model(BaseHTTPRequestHandler):
    """A model that takes the last of its moves."""

    def do_POST(self):
        asked = json.loads(self.rfile.read(int(self.headers["content-length"])))
        moves = asked["response_format"]["json_schema"]["schema"]["properties"]["move"]["enum"]
        message = {"role": "assistant", "content": json.dumps({"move": moves[-1]})}
        body = json.dumps({"choices": [{"message": message}]}).encode()
        self.send_response(200)
        self.send_header("content-length", str(len(body)))
        self.end_headers()
        self.wfile.write(body)

    def log_message(self, *_):
        pass


def test_the_hunters_of_language_model_do_what_a_server_answers():
    with ThreadingHTTPServer(("127.0.0.1", 0), Model) as server:
        thread = Thread(target=server.serve_forever, kwargs={"poll_interval": 0.01})
        thread.start()
        address = f"http://127.0.0.1:{server.server_port}/v1"
        game = GAMES["language_model"].replace(**{"teams.hunters.strategy.with.client": address, "max_turns": 2})
        try:
            outcomes = game.play().table("llm")["outcome"]
        finally:
            server.shutdown()
            thread.join()
    assert outcomes.tolist() == ["answer"] * 4


@pytest.mark.skipif(os.environ.get("GAMMS_ALL_PLAYS") != "1", reason="takes a quarter of an hour")
@pytest.mark.parametrize("name", list_statistics())
def test_the_games_of_a_hundred_seeds_are_won_as_the_page_says(name):
    assert measured(name) == json.loads(RESULTS.read_text())[name]


def test_the_gallery_page_describes_each_game_and_its_winners():
    words = " ".join((Path(__file__).parents[2] / "docs" / "gallery.md").read_text().split())
    for name, game in GAMES.items():
        found = list_statistics()[name]
        results = str(found).partition(" of 100 games")[0]
        assert f"{game.spec.description} {'Scores' if found.scores else 'Wins'}: {results}." in words, name

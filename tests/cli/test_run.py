"""`gamms run`: one game with a film or a window, and many seeds."""

import csv
import json
import os
import re
import shutil
import signal
import sys
import threading
import time
from collections import Counter
from pathlib import Path

import av
import pytest
from typer.testing import CliRunner

from gamms import cli, recorder, recordings, scenario
from gamms.game import Result
from gamms.visual.themes import THEMES
from gamms.web.bundle import format_css

TOWN = Path(__file__).parents[1] / "osm_online/data/kluuvi.osm.gz"

GAME = """
name: Little
map: {grid: {width: 6, height: 6}}
max_turns: 40
teams:
  red: {count: 2, strategy: "gamms.strategies:random_walk"}
  blue: {count: 2, strategy: "players:play"}
rules:
  - {rule: tag, with: {taggers: red, tagged: blue, then: eliminate}}
  - last_team
"""
PLAY = "def play(state):\n    state['action'] = state['draw'].choice(state['legal'])\n"


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    """The commands are given in a folder with a game."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "game.yaml").write_text(GAME)
    (tmp_path / "players.py").write_text(PLAY)
    return tmp_path


def run(*arguments):
    return CliRunner().invoke(cli.app, ["run", "game.yaml", *map(str, arguments)], catch_exceptions=False)


def test_a_game_is_filmed(folder):
    done = run("--seed", 1, "--max-turns", 3, "--film", "game.mp4")
    assert done.exit_code == 0
    assert "game.mp4 (the game as a film)" in done.stdout
    with av.open("game.mp4") as film:
        assert sum(1 for _ in film.decode(video=0)) >= 15


def test_a_film_of_an_unknown_kind_is_refused():
    done = run("--seed", 1, "--film", "game.mov")
    assert done.exit_code == 1
    assert ".mp4" in done.stderr


def test_it_prints_the_result_and_saves_it(folder):
    done = run("--seed", 3)
    result = Result.load("gamms-run/result.json")
    assert f"Little: {result}" in done.stdout
    assert result == scenario.load("game.yaml").play(seed=3)
    assert result.provenance["scenario"]["name"] == "Little"
    assert result.provenance["strategies"]["blue_0"] == "players:play"


def test_the_recording_of_one_game_has_what_sensors_saw_unless_it_is_left_out(folder):
    eyes = ", sensors: {eyes: {type: AGENT_RANGE, range_m: 20}}"
    (folder / "game.yaml").write_text(GAME.replace('random_walk"', f'random_walk"{eyes}'))
    assert run("--seed", 3, "--out", "with").exit_code == 0
    assert run("--seed", 3, "--out", "without", "--no-sensed").exit_code == 0
    game = scenario.load("game.yaml")
    for name, sensed in (("with", True), ("without", False)):
        game.play(3, record=f"{name}.ggr", sensed=sensed)
        assert Path(f"{name}/game.ggr").read_bytes() == Path(f"{name}.ggr").read_bytes()
        with recorder.open(f"{name}.ggr") as recording:
            assert bool(recording.counts().get("SENSED")) == sensed
    assert Result.load("with/result.json") == Result.load("without/result.json")


@pytest.mark.parametrize(("scenery", "is_drawn"), [("", True), (", scenery: true", True), (", scenery: false", False)])
def test_the_picture_of_a_town_has_its_parks_and_water_and_the_recording_what_the_scenario_says(
    folder, scenery, is_drawn
):
    shutil.copy(TOWN, folder / "town.osm.gz")
    game = GAME.replace("{grid: {width: 6, height: 6}}", f"{{file: {{path: town.osm.gz{scenery}}}}}")
    (folder / "game.yaml").write_text(game)
    done = run("--max-turns", 1, "--seed", 1)
    assert (done.exit_code, done.stderr) == (0, "")
    picture = Path("gamms-run/final.svg").read_text()
    tones = THEMES["light"].map.ground
    assert [f'fill="{format_css(tone)}"' in picture for tone in (tones.green, tones.water)] == [is_drawn, is_drawn]
    with recordings.context_for("gamms-run/game.ggr") as ctx:
        next(iter(ctx.record.replay("gamms-run/game.ggr")))
        assert bool(len(ctx.graph.scenery_columns().kinds)) == (scenery == ", scenery: true")


@pytest.mark.parametrize("jobs", [1, 2])
def test_many_seeds_are_the_games_of_each_seed(folder, jobs):
    (folder / "players.py").write_text(f"import os\n{PLAY}    open(f'played-in-{{os.getpid()}}', 'a').close()\n")
    done = run("--seeds", "0:5", "--jobs", jobs, "--out", "many")
    assert done.exit_code == 0, done.stderr
    assert (folder / f"played-in-{os.getpid()}").exists() == (jobs == 1)  # the others play in processes of their own
    game = scenario.load("game.yaml")
    expected = [game.play(seed=seed) for seed in range(5)]
    assert [Result.load(f"many/result_{seed}.json") for seed in range(5)] == expected
    rows = list(csv.DictReader((folder / "many/results.csv").read_text().splitlines()))
    assert [(row["seed"], row["turns"], row["winner"]) for row in rows] == [
        (str(seed), str(one.turns), one.winner or "") for seed, one in enumerate(expected)
    ]
    assert list(rows[0]) == [
        "seed", "turns", "winner", "reason", "truncated", "score_red", "score_blue", "alive_red", "alive_blue",
    ]  # fmt: skip
    living = [Counter(one["team"] for one in result.agents.values() if one["alive"]) for result in expected]
    assert [(row["alive_red"], row["alive_blue"]) for row in rows] == [
        (str(one["red"]), str(one["blue"])) for one in living
    ]
    red, blue = (sum(one.winner == team for one in expected) for team in ("red", "blue"))
    mean = sum(one.turns for one in expected) / 5
    wins = f"red won {red} ({red / 5:.0%}), blue won {blue} ({blue / 5:.0%})"
    assert f"5 games: {wins}. Mean length {mean:.1f} turns" in done.stdout
    assert [line.split()[0] for line in done.stdout.splitlines()[1:6]] == list("01234")


def test_seeds_may_be_listed():
    done = run("--seeds", "7,3", "--max-turns", 1, "--jobs", 1)
    assert [line.split()[0] for line in done.stdout.splitlines()[1:3]] == ["7", "3"]


@pytest.mark.parametrize("jobs", [1, 2])
def test_an_error_says_with_which_seed(folder, jobs):
    (folder / "players.py").write_text(f"{PLAY}    if state['turn'] == 0: 1 / 0\n")
    done = run("--seeds", "5:8", "--jobs", jobs)
    assert done.exit_code == 1
    assert done.stderr.splitlines()[-3:] == [
        "ZeroDivisionError: division by zero",
        "In the strategy of agent 'blue_0', in turn 0.",
        "With seed 5; to play it alone: --seed 5",
    ]
    assert re.search(r'players.py", line 3', done.stderr)


@pytest.mark.parametrize(
    ("arguments", "hint"),
    [
        (["--seeds", "x"], "give 0:50 or 1,2,5"),
        (["--seeds", "50"], "50:51 is the one game with the seed 50, and 0:50 are 50 games"),
        (["--seeds", "7,3,7"], "a seed occurs twice"),
        (["--seeds", "5:1"], "'5:1' is empty; did you mean 1:5?"),
        (["--seeds", "5:5"], "1 to 1,000,000 seeds"),
        (["--seeds", "0:99999999999"], "1 to 1,000,000 seeds"),
        (["--seeds", "0:99999999999999999999"], "'0:99999999999999999999': give 1 to 1,000,000 seeds, such as 0:50"),
        (["--seeds", "-99999999999999999999:0"], "1 to 1,000,000 seeds"),
        (["--seeds", "0:5", "--film", "a.mp4"], "for a single game"),
        (["--seeds", "0:5", "--seed", "1"], "for a single game"),
        (["--seeds", "0:5", "--window"], "for a single game"),
        (["--seeds", "0:5", "--no-sensed"], "--no-sensed: this option is for a single game"),
        (["--web", "--no-sensed"], "--no-sensed: this option is for a single game"),
        (["--jobs", "0"], "--jobs"),
    ],
)
def test_conflicting_options_are_refused(folder, arguments, hint):
    done = run(*arguments)
    assert done.exit_code == 2
    assert hint in " ".join(done.stderr.split())
    assert not (folder / "gamms-run").exists()


def test_code_from_elsewhere_is_announced_and_the_callers_own_is_not(folder, tmp_path_factory):
    elsewhere = tmp_path_factory.mktemp("elsewhere") / "mine.py"
    elsewhere.write_text(PLAY)
    assert "imports" not in run("--max-turns", 1, "--strategy", "red=players.py:play").stdout
    done = run("--max-turns", 1, "--strategy", f"red={elsewhere}:play")
    assert [line for line in done.stdout.splitlines() if line.startswith("imports")] == [
        f"imports --strategy red: mine:play, from {elsewhere}"
    ]


@pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")
def test_a_game_is_served_until_ctrl_c_and_its_result_is_there_before(folder, monkeypatch):
    pytest.importorskip("uvicorn")
    results = []

    def wait_for_the_end():
        try:
            until = time.monotonic() + 60.0
            while "The last turn is served" not in Path("said").read_text() and time.monotonic() < until:
                time.sleep(0.02)
            results.append(Result.load("served/result.json"))
        finally:
            signal.pthread_kill(threading.main_thread().ident, signal.SIGINT)

    before = signal.signal(signal.SIGINT, signal.default_int_handler)  # shells ignore it for what runs behind them
    waiting = threading.Thread(target=wait_for_the_end)
    with Path("said").open("w", buffering=1) as said:
        monkeypatch.setattr(sys, "stdout", said)
        waiting.start()
        words = ["run", "game.yaml", "--web", "--seed", "3", "--out", "served"]
        cli.app(words, standalone_mode=False)
    waiting.join()
    signal.signal(signal.SIGINT, before)
    assert results == [scenario.load("game.yaml").play(seed=3)]
    assert (folder / "served" / "game.ggr").exists()
    links = re.findall(r"^  (.*?) +http", Path("said").read_text(), re.MULTILINE)
    assert links[:2] == ["pause and change", "watch everything"]
    assert all(words.startswith("watch as ") for words in links[2:])


def test_a_game_whose_window_is_closed_says_so_and_leaves_a_recording_that_a_window_can_close_too(folder, monkeypatch):
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    import pygame

    from gamms.visual.window import engine

    draw = engine.WindowEngine.handle_single_draw

    def close(self):
        draw(self)
        if self.overlay.turns == 2:
            pygame.event.post(pygame.event.Event(pygame.QUIT))

    monkeypatch.setattr(engine.WindowEngine, "handle_single_draw", close)
    done = run("--seed", 1, "--window", "--out", "out")
    assert done.exit_code == 0, done.stderr
    assert "after 2 turns: closed" in done.stdout
    assert json.loads((folder / "out/result.json").read_text())["reason"] == "closed"
    done = CliRunner().invoke(cli.app, ["verify", "out/game.ggr"])
    assert done.exit_code == 0, done.stderr
    assert "all is well" in done.stdout

    assert run("--seed", 1, "--max-turns", 5, "--out", "out").exit_code == 0
    done = CliRunner().invoke(cli.app, ["replay", "out/game.ggr", "--window", "--seconds", "0.2"])
    assert (done.exit_code, done.stdout.strip(), done.stderr) == (0, "game.ggr: closed at turn 2", "")


def test_the_game_is_shown_in_a_window(folder, monkeypatch):
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    import pygame

    shown = []
    from gamms.visual.window import engine

    monkeypatch.setattr(engine.WindowEngine, "stay_open", lambda self: shown.append(self.ctx.game.turn))
    done = run("--seed", 1, "--max-turns", 1, "--window")
    assert done.exit_code == 0, done.stderr
    assert shown == [1]
    assert not pygame.display.get_init()
    assert json.loads((folder / "gamms-run/result.json").read_text())["turns"] == 1

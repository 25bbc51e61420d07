"""`gamms demo`: what a newcomer runs first, through its command line."""

import json
import os
import runpy
import subprocess
import sys
import xml.etree.ElementTree as ET
from pathlib import Path

import av
import pytest
from PIL import Image
from typer.testing import CliRunner

from gamms import cli, recorder
from gamms.cli import play


def run(*arguments):
    return CliRunner().invoke(cli.app, ["demo", "--no-film", *map(str, arguments)], catch_exceptions=False)


def squares(side, step=0.0005):
    """A town of square blocks as an OpenStreetMap file."""
    nodes = [
        f'<node id="{1 + i * side + j}" lat="{60 + i * step}" lon="{25 + 2 * j * step}" version="1"/>'
        for i in range(side)
        for j in range(side)
    ]
    rows = [[1 + i * side + j for j in range(side)] for i in range(side)]
    ways = [
        f'<way id="{k}" version="1">{"".join(f"<nd ref={chr(34)}{n}{chr(34)}/>" for n in way)}'
        '<tag k="highway" v="residential"/></way>'
        for k, way in enumerate([*rows, *map(list, zip(*rows, strict=True))], 1)
    ]
    return f'<?xml version="1.0"?><osm version="0.6">{"".join(nodes + ways)}</osm>'


@pytest.fixture(scope="module")
def town(tmp_path_factory):
    """A small map: pictures of Helsinki take longer than the games of these tests."""
    path = tmp_path_factory.mktemp("maps") / "town.osm"
    path.write_text(squares(6))
    return path


def test_it_prints_what_happened_and_draws_the_picture_of_the_readme(tmp_path):
    done = run("--out", tmp_path)

    assert done.exit_code == 0
    assert "Capture the flag in Central Helsinki, seed 1" in done.stdout
    assert "OpenStreetMap contributors" in done.stdout
    assert "red_" in done.stdout
    result = json.loads((tmp_path / "result.json").read_text())
    assert len(result["agents"]) == 10
    assert result["provenance"]["scenario"]["name"] == "Capture the flag"
    with recorder.open(tmp_path / "game.ggr") as recording:
        agents = recording[-1].agents
        nodes = dict(zip(agents["name"].tolist(), agents["node"].tolist(), strict=True))
        assert nodes == {name: agent["node"] for name, agent in result["agents"].items()}
        assert recording.turns == result["turns"]
        assert list(recording.events()) == result["events"]
    root = Path(__file__).parents[2]
    runpy.run_path(str(root / "scripts" / "animate_game.py"))["main"](tmp_path / "game.ggr", tmp_path / "moving.svg")
    drawn = (tmp_path / "moving.svg").read_text()
    assert drawn == (root / "docs" / "demo.svg").read_text(), "run make figures"
    assert "blue_1 brings the red flag home" in "".join(ET.fromstring(drawn).itertext())
    text = "".join(ET.fromstring((tmp_path / "final.svg").read_text()).itertext())
    assert "OpenStreetMap contributors" in text
    assert sum(agent in text for agent in result["agents"]) > 4


def test_it_films_the_game_and_names_all_that_it_wrote(town, tmp_path):
    arguments = ["--max-turns", "10", "--map", str(town), "--out", str(tmp_path)]
    done = CliRunner().invoke(cli.app, ["demo", *arguments], catch_exceptions=False)
    files = {"game.html", "result.json", "game.ggr", "game.mp4", "final.png", "final.svg"}
    assert {path.name for path in tmp_path.iterdir()} == files
    assert all(f"{tmp_path / name}" in done.stdout for name in files)
    assert "Not made" not in done.stdout
    with av.open(str(tmp_path / "game.mp4")) as film:
        assert sum(1 for _ in film.decode(video=0)) == 20 + 25 + 62  # the last one is held, and then there is a card


@pytest.mark.parametrize(
    ("missing", "film", "picture"),
    [
        ("av", ["game.gif"], ["final.png", "final.svg"]),
        ("PIL", [], ["final.svg"]),
    ],
)
def test_files_that_need_missing_libraries_are_left_out_with_a_sentence(
    town, tmp_path, missing, film, picture, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setitem(sys.modules, missing, None)
    done = CliRunner().invoke(cli.app, ["demo", "--max-turns", "3", "--map", str(town), "--out", "out"])
    assert done.exit_code == 0, done.stderr
    check_what_is_left_out(tmp_path / "out", done.stdout, film, picture)
    if film == ["game.gif"]:
        with Image.open("out/game.gif") as gif:
            assert (gif.height, gif.n_frames) == (640, 1 + 3)  # the start, and each turn


def test_without_pygame_there_is_no_film(town, tmp_path):  # in a process that has not loaded it yet
    code = "import sys; sys.modules['pygame'] = None; from gamms.cli import main; main()"
    command = [sys.executable, "-c", code, "demo", "--max-turns", "3", "--map", str(town), "--out", "out"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    check_what_is_left_out(tmp_path / "out", done.stdout, [], ["final.svg"])


def check_what_is_left_out(folder, printed, film, picture):
    """Assert that a demo has made these files, and says of the others what they need."""
    assert sorted(path.name for path in folder.iterdir()) == sorted(
        [*film, *picture, "game.ggr", "game.html", "result.json"]
    )
    [sentence] = [line for line in printed.splitlines() if line.startswith("Skipped")]
    for name, needed in (("game.mp4", ("pygame-ce", "av>=")), ("final.png", ("pygame-ce", "pillow"))):
        is_there = name in [*film, *picture]
        assert (name in sentence) is not is_there
        assert is_there or all(library in sentence for library in needed)


def test_the_same_seed_gives_the_same_bytes_in_any_process(town, tmp_path, monkeypatch):
    arguments = ["demo", "--max-turns", "15", "--seed", "5", "--map", str(town), "--out", "here", "--no-film"]
    for name in ("this", "other"):
        (tmp_path / name).mkdir()
    monkeypatch.chdir(tmp_path / "this")
    printed = CliRunner().invoke(cli.app, arguments, catch_exceptions=False).stdout
    other = subprocess.run(
        [sys.executable, "-m", "gamms", *arguments],
        cwd=tmp_path / "other",
        env={**os.environ, "PYTHONHASHSEED": "7"},
        capture_output=True,
        check=True,
    )
    assert other.stdout.decode() == printed
    for name in ("result.json", "game.ggr", "final.svg"):
        assert len({(tmp_path / place / "here" / name).read_bytes() for place in ("this", "other")}) == 1, name


def test_another_seed_plays_another_game(town, tmp_path):
    for seed in (1, 2):
        run("--max-turns", 20, "--map", town, "--seed", seed, "--out", tmp_path / str(seed))
    assert (tmp_path / "1" / "final.svg").read_bytes() != (tmp_path / "2" / "final.svg").read_bytes()


def test_teams_may_have_names_and_sizes_of_their_own_up_to_a_thousand(town, tmp_path, monkeypatch):
    monkeypatch.setattr(play, "_MOST_AGENTS", 3)  # in place of a thousand
    assert "1 to 3 agents each" in run("--teams", "cats=4,dogs=2", "--out", tmp_path).stderr
    run("--max-turns", 20, "--map", town, "--teams", "cats=3,dogs=2", "--out", tmp_path)
    result = json.loads((tmp_path / "result.json").read_text())
    assert list(result["agents"]) == ["cats_0", "cats_1", "cats_2", "dogs_0", "dogs_1"]


@pytest.mark.parametrize(
    ("arguments", "hint"),
    [
        (["--max-turns", "0"], "--max-turns"),
        (["--teams", "many"], "cats=5,dogs=3"),
        (["--teams", "0"], "1 to 1000"),
        (["--teams", "a=1,a=2"], "two names"),
        (["--seed", "x"], "--seed"),
    ],
)
def test_a_wrong_argument_is_named_and_nothing_is_written(tmp_path, arguments, hint):
    done = run(*arguments, "--out", tmp_path / "out")
    assert done.exit_code == 2
    assert hint in done.stderr
    assert not (tmp_path / "out").exists()


def test_it_plays_on_any_map(town, tmp_path):
    done = run("--max-turns", 60, "--map", town, "--out", tmp_path)
    assert done.exit_code == 0
    assert "town.osm" in done.stdout
    played_on = json.loads((tmp_path / "result.json").read_text())["provenance"]["scenario"]["map"]["file"]
    assert played_on["path"] == "town.osm"
    assert played_on["scenery"]
    assert CliRunner().invoke(cli.app, ["verify", str(tmp_path / "game.ggr")]).exit_code == 0


@pytest.mark.parametrize(
    ("content", "hint"),
    [("this is no map", "bad.osm"), (squares(2, 0.00002), "at least 50"), (None, "bad.osm")],
    ids=["no map", "too small", "missing"],
)
def test_a_bad_map_ends_in_one_sentence(tmp_path, content, hint):
    path = tmp_path / "bad.osm"
    if content is not None:
        path.write_text(content)
    done = run("--map", path, "--out", tmp_path / "out")
    assert done.exit_code == 1
    assert done.stderr.startswith("gamms: ")
    assert hint in done.stderr
    assert "Traceback" not in done.stderr


def test_the_version_and_the_form_of_the_core_can_be_asked_for():
    import gamms

    version, core = CliRunner().invoke(cli.app, ["--version"]).stdout.splitlines()
    assert version == f"gamms {gamms.__version__}"
    assert core == ("core: compiled" if gamms.core.is_compiled else "core: interpreted (the same games, slower)")

"""`gamms new`: a game to begin with."""

import pytest
from typer.testing import CliRunner

from gamms import cli, scenario


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def run(*arguments):
    return CliRunner().invoke(cli.app, list(map(str, arguments)), catch_exceptions=False)


@pytest.mark.parametrize(
    ("options", "agents"), [([], 5), (["--from", "pursuit"], 5), (["--from", "capture_the_flag"], 10)]
)
def test_a_new_game_can_be_played_at_once(folder, options, agents):
    done = run("new", "hunt", *options)
    assert done.exit_code == 0
    assert sorted(path.name for path in (folder / "hunt").iterdir()) == ["hunt.yaml", "strategies.py"]
    for command in (
        "gamms run hunt/hunt.yaml --out hunt/first ",
        "gamms run hunt/hunt.yaml --window ",
        "gamms render hunt/first/game.ggr hunt.html ",
        "gamms render hunt/first/game.ggr hunt.mp4 ",
        "gamms run hunt/hunt.yaml --seeds 0:50 ",
    ):
        assert f"\n  {command}" in done.stdout
    game = scenario.load("hunt/hunt.yaml")
    assert game.spec.name == "hunt"
    assert game.warnings() == []
    assert {one.module for one in game.code() if "strategy" in one.path} == {"strategies"}
    result = game.replace(max_turns=3).play()
    assert len(result.agents) == agents
    assert sum(one["moves"] for one in result.agents.values()) > agents
    checked = run("scenario", "check", "hunt/hunt.yaml", "--build")
    assert (checked.exit_code, "the whole game, built once" in checked.output) == (0, True)


@pytest.mark.parametrize("source", list(scenario.gallery()))
def test_every_game_that_comes_with_gamms_can_be_begun_with(folder, source):
    assert run("new", "mine", "--from", source).exit_code == 0
    copy, original = scenario.load("mine/mine.yaml", allow=["gamms.llm"]), scenario.from_gallery(source)
    assert [(one.path, one.function) for one in copy.code()] == [(one.path, one.function) for one in original.code()]
    assert all(found.file.parent == folder / "mine" for found in copy.code() if found.file is not None)
    assert copy.spec.name == "mine"
    text = (folder / "mine" / "mine.yaml").read_text()
    assert f"{source}.py" not in text, "names a file that is not beside it"
    assert f"{source}.yaml" not in text


@pytest.mark.parametrize("source", ["patrol", "people_and_machines", "scotland_yard"])
def test_a_copy_of_a_game_runs(folder, source):
    assert run("new", "mine", "--from", source).exit_code == 0
    assert run("scenario", "check", "mine/mine.yaml").exit_code == 0
    played = run("run", "mine/mine.yaml", "--max-turns", 2, "--out", "mine/first")
    assert played.exit_code == 0
    assert "after 2 turns" in played.stdout
    assert (folder / "mine" / "first" / "game.ggr").exists()


def test_the_game_can_be_won_by_both_sides(folder):
    run("new", "hunt")
    game = scenario.load("hunt/hunt.yaml")
    assert {game.play(seed=seed).winner for seed in (4, 5)} == {"pursuers", "evaders"}


def test_existing_files_are_not_overwritten(folder):
    (folder / "hunt").mkdir()
    done = run("new", "hunt")
    assert (done.exit_code, list((folder / "hunt").iterdir())) == (1, [])
    assert "'hunt' already exists" in done.stderr


@pytest.mark.parametrize(
    ("arguments", "hint"),
    [
        (["hunt", "--from", "pursiut"], "Unknown game 'pursiut'. Did you mean 'pursuit'?"),
        (["a b"], "letters, digits"),
        ([".."], "letters, digits"),
    ],
)
def test_a_wrong_name_is_refused(folder, arguments, hint):
    done = run("new", *arguments)
    assert done.exit_code == 1
    assert hint in done.stderr
    assert list(folder.iterdir()) == []


def test_a_game_may_be_in_a_folder_below(folder):
    assert run("new", "games/hunt").exit_code == 0
    assert scenario.load("games/hunt/hunt.yaml").spec.name == "hunt"

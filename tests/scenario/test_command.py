"""`gamms run` and `gamms scenario`, through the command line."""

import json

import pytest
import yaml
from typer.testing import CliRunner

from gamms import cli


@pytest.fixture(autouse=True)
def in_folder(folder, monkeypatch):
    """The commands are given in the folder of the scenario."""
    monkeypatch.chdir(folder)


def run(*arguments):
    return CliRunner().invoke(cli.app, list(map(str, arguments)), catch_exceptions=False)


def test_a_game_is_played_and_written(folder):
    done = run("run", "little.yaml", "--seed", 7, "--max-turns", 4, "--set", "teams.red.count=2", "--out", "out")
    assert done.exit_code == 0
    assert "little: no team won after 4 turns: all turns are played (seed 7)" in done.stdout
    result = json.loads((folder / "out" / "result.json").read_text())
    assert (result["turns"], result["seed"]) == (4, 7)
    assert sorted(result["agents"]) == ["anna", "bert", "red_0", "red_1"]
    assert (folder / "out" / "final.svg").read_text().startswith("<svg") or (folder / "out" / "final.svg").stat()


def test_code_is_named_before_it_is_imported(folder):
    (folder / "players.py").write_text("def wander(state):\n    pass\nraise RuntimeError('this was run')\n")
    done = run("scenario", "check", "little.yaml", "--build")
    assert done.exit_code == 1
    assert f"imports teams.red.strategy: players:wander, from {folder / 'players.py'}" in done.stdout
    assert "imports item 1 of rules (tag): gamms.rules:tag, installed" in done.stdout
    done = run("run", "little.yaml")
    assert done.exit_code == 1
    assert "imports" not in done.stdout  # what is in the folder of the scenario is the caller's own
    assert "importing 'players:wander' failed: RuntimeError: this was run" in done.stderr
    assert not (folder / "gamms-run").exists()


@pytest.mark.parametrize(
    ("arguments", "code", "hint"),
    [
        (["--set", "teams.red.cuont=8"], 1, "Did you mean 'count'?"),
        (["--set", "teams.rde.count=8"], 1, "Did you mean 'red'?"),
        (["--set", "max_turns"], 2, "teams.red.count=8"),
        (["--set", "=8"], 2, "teams.red.count=8"),
        (["--strategy", "mine.py:strategy"], 2, "red=mine.py:strategy"),
        (["--strategy", "red=mine.py"], 1, "module:function"),
        (["--strategy", "red=mine.py:strategy"], 1, "no file 'mine.py'"),
        (["--strategy", "rde=players.py:wander"], 1, "Did you mean 'red'?"),
        (["--max-turns", "-1"], 2, "--max-turns"),
    ],
)
def test_a_wrong_argument_ends_in_one_sentence(folder, arguments, code, hint):
    done = run("run", "little.yaml", *arguments)
    assert done.exit_code == code
    assert hint in done.stderr
    assert not (folder / "gamms-run").exists()


@pytest.mark.parametrize(
    ("old", "new", "hint"),
    [
        ("count:", "cuont:", "teams.red.cuont: unknown key, with the value 3. Did you mean 'count'?"),
        ("players:wander", "player:wander", "teams.red.strategy: there is no module 'player'"),
        ("within: 30", "within: 5", "teams.red: only 1 of 3 agents could be placed, within 5 of node 0."),
    ],
)
def test_a_check_names_the_error(folder, old, new, hint):
    file = folder / "little.yaml"
    file.write_text(file.read_text().replace(old, new))
    done = run("scenario", "check", "little.yaml")
    assert done.exit_code == 1
    assert done.stderr.startswith("gamms: little.yaml: ")
    assert hint in done.stderr


def test_the_schema_is_printed():
    schema = json.loads(run("scenario", "schema").stdout)
    assert schema["$ref"] == "#/$defs/Spec"


def test_a_package_is_allowed_by_the_caller(folder):
    text = (folder / "little.yaml").read_text()
    (folder / "little.yaml").write_text(text.replace("facts:", "facts:\n  x: {function: 'networkx:freeze'}", 1))
    for command in (["run"], ["scenario", "check"], ["scenario", "check", "--build"]):
        done = run(*command, "little.yaml")
        assert done.exit_code == 1
        assert "facts.x: the installed package 'networkx' does not offer networkx:freeze to scenarios." in done.stderr
        done = run(*command, "little.yaml", "--allow", "networkx")
        assert done.exit_code == 0


def test_names_cannot_command_the_terminal(folder):
    given = json.loads(json.dumps(yaml.safe_load((folder / "little.yaml").read_text())))
    given["name"] = "little \x1b[2J"
    given["teams"]["\x1b]0;green\x07"] = {"count": 1, "strategy": "players:wander"}
    given["conflicts"]["resolve"]["by_priority"].append("\x1b]0;green\x07")
    (folder / "odd.json").write_text(json.dumps(given))
    played, checked = run("run", "odd.json"), run("scenario", "check", "odd.json", "--build")
    assert r"imports teams.\u001b]0;green\u0007.strategy: players:wander" in checked.stdout
    given["teams"]["\x1b]0;green\x07"]["\x1b[2J"] = 3
    (folder / "odd.json").write_text(json.dumps(given))
    refused = run("run", "odd.json")
    assert refused.exit_code == 1
    for done in (played, checked, refused):
        assert "\x1b" not in done.output
        assert "\x07" not in done.output

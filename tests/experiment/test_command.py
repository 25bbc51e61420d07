"""`gamms experiment`, and files of experiments."""

import csv
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from typer.testing import CliRunner

from gamms import cli, experiment
from gamms.cli import experiments
from gamms.errors import BadValue
from gamms.experiment import folders
from gamms.experiment.files import parse_seeds, read_experiment
from gamms.scenario import ScenarioError

GAME = """
max_turns: 5
map: {grid: {width: 4, height: 4}}
teams:
  red: {count: 2, strategy: "gamms.strategies:random_walk"}
  blue: {count: 1, strategy: "gamms.strategies:random_walk"}
"""
HUNTS = """
scenario: game.yaml
seeds: 0:3
vary:
  teams.red.count: [1, 2]
  strategies.blue: {walking: null, still: "players:stay"}
out: results
"""
PLAYERS = """
import time

def stay(state):
    state["action"] = state["curr_pos"]

def sleep(state):
    time.sleep(0.05)
"""


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    """The commands are given in a folder with an experiment."""
    monkeypatch.chdir(tmp_path)
    for name, text in (("game.yaml", GAME), ("hunts.yaml", HUNTS), ("players.py", PLAYERS)):
        (tmp_path / name).write_text(text)
    return tmp_path


def run(*arguments):
    return CliRunner().invoke(cli.app, ["experiment", *map(str, arguments)], catch_exceptions=False)


def test_a_file_is_played_and_its_summary_printed(folder, monkeypatch):
    done = run("hunts.yaml", "--workers", 0)
    assert done.exit_code == 0
    assert done.stdout.splitlines()[0].split() == [
        *("teams.red.count", "strategies.blue", "metric", "games", "seeds", "errors", "mean", "low", "high"),
        *("t_low", "t_high"),
    ]
    with (folder / "results" / "rows.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 12
    assert {row["strategies.blue"] for row in rows} == {"walking", "still"}
    assert all(row["moves.blue"] == "0" for row in rows if row["strategies.blue"] == "still")
    assert str(Path("results", "rows.csv")) in done.stdout
    assert "variants together" not in done.stdout
    monkeypatch.setattr(experiments, "_MOST_VARIANTS", 3)
    together = run("hunts.yaml", "--workers", 0).stdout
    assert "This is of all 4 variants together" in together
    assert "teams.red.count" not in together
    (folder / "results" / "rows.parquet").touch()  # of a run where the library was installed
    again = run("hunts.yaml", "--workers", 0)
    assert again.stdout.splitlines()[0] == "results already has 12 games; the run continues from there."
    assert "rows.parquet: pip install" not in again.stdout


def test_processes_give_the_same_files(folder):
    (folder / "players.py").write_text(
        "import os\n\ndef stay(state):\n    open(f'played-in-{os.getpid()}', 'a').close()\n"
    )
    run("hunts.yaml", "--workers", 1, "--out", "there")
    assert not (folder / f"played-in-{os.getpid()}").exists()
    run("hunts.yaml", "--workers", 0, "--out", "here")
    assert (folder / f"played-in-{os.getpid()}").exists()
    assert (folder / "here" / "rows.jsonl").read_bytes() == (folder / "there" / "rows.jsonl").read_bytes()


def test_shards_are_merged(folder):
    run("hunts.yaml", "--workers", 0, "--out", "whole")
    for part in ("1/2", "2/2"):
        assert "gamms experiment merge results" in run("hunts.yaml", "--workers", 0, "--shard", part).stdout
    assert run("merge", "results").exit_code == 0
    assert (folder / "results" / "rows.csv").read_bytes() == (folder / "whole" / "rows.csv").read_bytes()


def test_games_that_raise_are_counted(folder):
    (folder / "players.py").write_text("def stay(state):\n    raise ValueError('no')\n")
    done = run("hunts.yaml", "--workers", 0, "--seeds", "4,5")
    assert done.exit_code == 0
    rows = map(json.loads, (folder / "results" / "rows.jsonl").read_text().splitlines())
    first = next(row["id"] for row in rows if row["error"])
    assert f"4 of 8 games have raised; row {first}: ValueError: no" in done.stderr
    assert "ValueError: no" in done.stderr


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[]", "an experiment is a mapping"),
        ("scenario: game.yaml", "seeds: is missing"),
        ("{scenario: game.yaml, seeds: 0:3, vray: {}}", "vray: unknown key.*Did you mean 'vary'"),
        ("{scenario: ../game.yaml, seeds: 0:3}", "leads out of the folder"),
        ("{scenario: /etc/passwd, seeds: 0:3}", "leads out of the folder"),
        ("{scenario: game.yaml, seeds: 0:3, out: ../x}", "leads out of the folder"),
        ("{scenario: game.yaml, seeds: 0:99999999999}", "would take about"),
        ("{scenario: game.yaml, seeds: three}", "seeds are 0:50 or 1,2,5"),
        ("{scenario: game.yaml, seeds: 3}", "3:4 is the one game with the seed 3, and 0:3 are 3 games"),
        ("{scenario: game.yaml, seeds: '50'}", "50:51 is the one game with the seed 50, and 0:50 are 50 games"),
        ("{scenario: game.yaml, seeds: 3.5}", "seeds are a list of integers"),
        ("{scenario: game.yaml, seeds: 0:3, workers: many}", "workers: is how many"),
        ("{scenario: game.yaml, seeds: 0:3, workers: 0}", "workers: is how many"),
        ("{scenario: game.yaml, seeds: 0:3, vary: {}, sample: {}}", "not both"),
        ("{scenario: game.yaml, seeds: 0:3, sample: {n: 4}}", "a sample has space and n"),
        ("{scenario: game.yaml, seeds: 0:3, sample: {n: 3, space: {max_turns: {min: 1, max: 9}}}}", "power of two"),
    ],
)
def test_a_file_that_is_none_is_refused(folder, text, message):
    (folder / "wrong.yaml").write_text(text)
    with pytest.raises(ScenarioError, match=message):
        read_experiment("wrong.yaml")


def test_a_file_may_say_how_many_processes_play(folder):
    (folder / "hunts.yaml").write_text(HUNTS + "workers: 1\n")
    assert read_experiment("hunts.yaml").workers == 1


def test_seeds_may_be_a_list():
    assert parse_seeds([7, 3]) == [7, 3]


def test_a_range_of_seeds_with_its_ends_exchanged_is_answered_with_the_right_one():
    with pytest.raises(BadValue, match=r"^seeds: '5:1' is empty; did you mean 1:5\?$"):
        parse_seeds("5:1")


@pytest.mark.parametrize("code", ["os:system", "subprocess:run", "gamms.llm:Strategy", "../players:stay"])
def test_a_file_names_no_code_from_elsewhere(folder, code):
    (folder / "hunts.yaml").write_text(HUNTS.replace("players:stay", code))
    done = run("hunts.yaml", "--workers", 0)
    assert done.exit_code == 1
    assert "teams.blue.strategy" in done.stderr


def test_a_file_may_have_a_sample(folder):
    (folder / "hunts.yaml").write_text(
        "{scenario: game.yaml, seeds: 0:2, sample: {n: 2, space: {max_turns: {min: 1, max: 5}}}}"
    )
    done = run("hunts.yaml", "--workers", 0)
    assert done.exit_code == 0
    assert len(experiment.load("hunts-results")) == 12


@pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")
def test_ctrl_c_keeps_the_rows_and_says_how_to_go_on(folder):
    (folder / "hunts.yaml").write_text(HUNTS.replace("players:stay", "players:sleep").replace("0:3", "0:300"))
    program = [sys.executable, "-m", "gamms", "experiment", "hunts.yaml", "--workers", "0"]
    running = subprocess.Popen(program, stderr=subprocess.PIPE, env=dict(os.environ))
    while not folders.read_journal(folder / "results" / "journal.jsonl"):
        assert running.poll() is None
        time.sleep(0.02)
    running.send_signal(signal.SIGINT)
    try:
        _, errors = running.communicate(timeout=20)
    except subprocess.TimeoutExpired:  # Python ignores an interrupt while a callback of a weak reference runs
        running.send_signal(signal.SIGINT)
        _, errors = running.communicate(timeout=60)
        assert errors.startswith(b"Exception ignored in")
        errors = errors[errors.rindex(b"KeyboardInterrupt") :]
    assert running.returncode == 130
    assert b"Interrupted with" in errors
    assert b"Traceback" not in errors

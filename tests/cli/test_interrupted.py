"""Ctrl-C in a command: what the folder has by then is complete, and a line says what it is."""

import contextlib
import csv
import re
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest
from typer.testing import CliRunner

from gamms import cli, recorder
from gamms.game import Result

GAME = """
map: {grid: {rows: 4, columns: 4}}
max_turns: 40
teams:
  red: {count: 1, strategy: "players:play"}
"""
PLAY = """
from pathlib import Path

def play(state):
    state["action"] = state["curr_pos"]
    asked = Path("asked")
    asked.write_text(asked.read_text() + "." if asked.exists() else ".")
    if len(asked.read_text()) > int(Path("limit").read_text()):
        raise KeyboardInterrupt
"""
CUP_GAME = """
map: {grid: {rows: 4, columns: 4}}
max_turns: 40
teams:
  red: {count: 1, strategy: "gamms.strategies:stay"}
  blue: {count: 1, strategy: "gamms.strategies:stay"}
"""
posix = pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    """The commands are given in a folder with a game in which Ctrl-C comes after a number of decisions."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "game.yaml").write_text(GAME)
    (tmp_path / "players.py").write_text(PLAY)
    return tmp_path


def gamms(*arguments, after):
    Path("limit").write_text(str(after))
    done = CliRunner().invoke(cli.app, [*map(str, arguments)], catch_exceptions=False)
    assert done.exit_code == 130
    return done


def test_a_game_leaves_a_recording_up_to_its_last_turn():
    done = gamms("run", "game.yaml", after=7)
    assert done.stdout.splitlines()[-1] == "Wrote gamms-run/game.ggr (every move up to turn 7; gamms replay)."
    assert done.stderr == "gamms: Interrupted.\n"
    with recorder.open("gamms-run/game.ggr") as recording:
        assert recording.turns == 7


def test_a_game_that_was_interrupted_in_its_first_turn_says_so():
    assert gamms("run", "game.yaml", after=0).stdout == "No turn was recorded.\n"


def test_a_game_in_a_window_leaves_a_recording_too(monkeypatch):
    pytest.importorskip("pygame")
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    done = gamms("run", "game.yaml", "--window", after=2)
    assert "(every move up to turn 2; gamms replay)" in done.stdout


def test_many_games_leave_the_rows_and_results_of_those_that_were_played():
    done = gamms("run", "game.yaml", "--seeds", "0:5", "--jobs", 1, after=95)
    lines = done.stdout.splitlines()
    assert [line.split()[:2] for line in lines[:3]] == [["seed", "turns"], ["0", "40"], ["1", "40"]]
    assert lines[-1] == "2 of 5 games were played."
    with Path("gamms-run/results.csv").open(newline="") as file:
        assert [row["seed"] for row in csv.DictReader(file)] == ["0", "1"]
    assert [Result.load(f"gamms-run/result_{seed}.json").turns for seed in (0, 1)] == [40, 40]


def test_many_games_of_which_none_was_played_leave_nothing():
    assert "0 of 5 games were played." in gamms("run", "game.yaml", "--seeds", "0:5", "--jobs", 1, after=3).stdout
    assert not Path("gamms-run").exists()


class Interrupting:
    """Sends Ctrl-C to this process once a file of a pattern exists."""

    def __init__(self, pattern):
        self._pattern = pattern
        self._thread = threading.Thread(target=self._wait)
        self._thread.start()

    def _wait(self):
        until = time.monotonic() + 60.0
        while not list(Path().glob(self._pattern)) and time.monotonic() < until:
            time.sleep(0.01)
        signal.pthread_kill(threading.main_thread().ident, signal.SIGINT)

    def end(self):
        self._thread.join()


def interrupted_process(pattern, *arguments):
    """Play a command in a process of its own, and send it Ctrl-C once a file of a pattern exists."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)  # shells ignore it for what runs behind them
    process = subprocess.Popen([sys.executable, "-m", "gamms", *arguments], stdout=subprocess.PIPE, text=True)
    signal.signal(signal.SIGINT, before)
    until = time.monotonic() + 60.0
    while not list(Path().glob(pattern)) and process.poll() is None and time.monotonic() < until:
        time.sleep(0.01)
    for wait in (3.0, 60.0):  # Python loses an interrupt that comes while an object is freed; a person types it again
        process.send_signal(signal.SIGINT)
        with contextlib.suppress(subprocess.TimeoutExpired):
            said, _ = process.communicate(timeout=wait)
            return process.returncode, said
    raise AssertionError("The command did not end.")


def gamms_until(pattern, *arguments):
    before = signal.signal(signal.SIGINT, signal.default_int_handler)  # shells ignore it for what runs behind them
    interrupting = Interrupting(pattern)
    try:
        return gamms(*arguments, after=10**6)
    finally:
        interrupting.end()
        signal.signal(signal.SIGINT, before)


@posix
def test_a_film_that_is_not_finished_leaves_the_earlier_file():
    pytest.importorskip("PIL")
    Path("limit").write_text("999999")
    Path("long.yaml").write_text(GAME.replace("max_turns: 40", "max_turns: 900"))  # its film takes seconds
    assert CliRunner().invoke(cli.app, ["run", "long.yaml"], catch_exceptions=False).exit_code == 0
    for said in ("film.gif was not written.", "film.gif is unchanged: its earlier file is still there."):
        assert interrupted_process(".film.gif.*", "render", "gamms-run/game.ggr", "film.gif") == (130, f"{said}\n")
        Path("film.gif").write_bytes(b"earlier")
    assert Path("film.gif").read_bytes() == b"earlier"


def test_an_experiment_says_that_the_same_command_goes_on():
    Path("runs.yaml").write_text("{scenario: game.yaml, seeds: 0:5}")
    done = gamms("experiment", "runs.yaml", "--workers", 0, after=95)
    assert re.fullmatch(r"Interrupted with \d games in runs-results; the same command goes on.\n", done.stderr)


@posix
def test_a_tournament_says_that_the_same_command_goes_on():
    for name in ("mine", "yours"):
        Path(f"{name}.py").write_text("import time\n\ndef play(state):\n    time.sleep(0.1)\n    state['action'] = 0\n")
    Path("cup.yaml").write_text(
        "{scenario: cup_game.yaml, seeds: 0:9, entries: {a: 'mine.py:play', b: 'yours.py:play'}}"
    )
    Path("cup_game.yaml").write_text(CUP_GAME)
    done = gamms_until("cup/games", "tournament", "cup.yaml", "--out", "cup", "--workers", 1)
    assert re.fullmatch(r"Interrupted with \d games in cup; the same command goes on.\n", done.stderr)

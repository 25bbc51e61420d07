"""What `gamms` says of itself, and of what goes wrong."""

import re
import sys
from pathlib import Path

import pytest
from typer.testing import CliRunner

import gamms
from gamms import cli
from gamms.cli import commands
from gamms.cli.output import explain_error, make_rich_table
from gamms.errors import BadValue

COMMANDS = [
    *(
        "demo",
        "gallery",
        "new",
        "run",
        "study",
        "tournament",
        "replay",
        "render",
        "info",
        "verify",
        "diff",
        "convert",
        "map",
        "suite",
    ),
]
GAME = """
map: {grid: {width: 4, height: 4}}
seed: 1
max_turns: 3
teams:
  red: {count: 1, strategy: "players:play"}
"""


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    """The commands are given in a folder with a game."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "game.yaml").write_text(GAME)
    (tmp_path / "players.py").write_text("def play(state):\n    state['action'] = state['curr_pos']\n")
    return tmp_path


def run(*arguments):
    return CliRunner().invoke(cli.app, list(map(str, arguments)), catch_exceptions=False)


def test_commands_are_in_the_order_of_their_use():
    commands = re.findall(r"^  ([a-z]+)  ", run("--help").stdout.partition("Commands:")[2], re.MULTILINE)
    assert commands == [*COMMANDS, "scenario", "osm", "experiment"]


@pytest.mark.parametrize(
    "command", [*([one] for one in COMMANDS), ["scenario", "check"], ["osm", "report"]], ids=" ".join
)
def test_each_help_has_examples_and_shows_flags_without_a_value(command):
    text = run(*command, "--help").stdout
    assert "Examples:" in text
    assert all(
        f"gamms {' '.join(command)} " in line or line.strip() == "gamms demo"
        for line in text.partition("Examples:\n")[2].splitlines()
    )
    assert "bool" not in text
    assert "{" not in text.partition("\n\n")[0]
    assert re.search(r"--traceback  +[A-Z]", text)


def test_every_summary_fits_on_its_line():
    for group in ([], ["scenario"], ["osm"], ["experiment"]):
        assert "..." not in run(*group, "--help").stdout.partition("Commands:")[2]


def test_a_command_without_an_output_ends_without_an_error(monkeypatch):
    monkeypatch.setattr(sys, "stdout", None)  # as Python has it where the output is closed
    monkeypatch.setattr(sys, "argv", ["gamms", "--version"])
    with pytest.raises(SystemExit) as end:
        commands.run()
    assert end.value.code == 0


def test_a_group_without_a_command_shows_its_help():
    for group in ("scenario", "osm", "experiment"):
        assert run(group).output == run(group, "--help").output


def test_an_error_of_a_strategy_shows_its_own_lines_and_who_played(folder):
    (folder / "players.py").write_text(
        "def step(state):\n    return state['legl'][0]\n\ndef play(state):\n    step(state)\n"
    )
    done = run("run", "game.yaml")
    assert done.exit_code == 1
    first, *frames, error, note = done.stderr.splitlines()
    assert first == "Traceback (most recent call last):"
    assert [line.split('"')[1] for line in frames if line.startswith("  File")] == [str(folder / "players.py")] * 2
    assert (error, note) == (
        "KeyError: 'legl'",
        "In the strategy of agent 'red_0', in turn 0. Did you mean 'legal'?",
    )


def test_an_error_of_imported_code_shows_the_line_and_the_place_in_the_scenario(folder):
    (folder / "players.py").write_text("def play(state):\n    pass\n\n1 / 0\n")
    done = run("run", "game.yaml")
    assert 'players.py", line 4, in <module>' in done.stderr
    assert "typer" not in done.stderr
    assert "importlib" not in done.stderr
    assert done.stderr.splitlines()[-1].startswith(
        "gamms: game.yaml: teams.red.strategy: importing 'players:play' failed"
    )


def test_an_error_of_gamms_in_a_strategy_names_the_line(folder):
    (folder / "players.py").write_text("def play(ctx):\n    return lambda state: ctx.graph.graph.get_node(99)\n")
    done = run("run", "game.yaml")
    assert 'players.py", line 2' in done.stderr
    assert "UnknownName: Unknown node 99" in done.stderr


def test_a_strategy_that_exits_is_named(folder):
    (folder / "players.py").write_text("import sys\n\ndef play(state):\n    sys.exit(3)\n")
    done = run("run", "game.yaml")
    assert done.exit_code == 1
    assert 'players.py", line 4, in play' in done.stderr
    assert "SystemExit: 3" in done.stderr


def test_all_frames_are_there_if_they_are_asked_for(folder):
    (folder / "players.py").write_text("def play(state):\n    1 / 0\n")
    with pytest.raises(ZeroDivisionError):
        run("run", "game.yaml", "--traceback")


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["run", "gane.yaml"], "There is no file 'gane.yaml' for a scenario. Did you mean 'game.yaml'?"),
        (["replay", "nope/game.ggr"], "There is no file 'nope/game.ggr' for a recording. There is no folder 'nope'."),
        (["run", "."], "a folder, not a scenario file: give the file in it, 'game.yaml'."),
        (["replay", "."], "a folder, not a recording, which contains none."),
        (["replay", "game.yaml"], "'game.yaml' is not a recording: `gamms run` plays scenarios."),
        (["run", "players.py"], "a scenario file ends in .yaml, .yml, .json, not '.py'."),
        (["run", "game.yaml", "--out", "players.py"], "There is 'players.py' already, and it is not a folder."),
        (["run", "game.yaml", "--strategy", "red=players.py:ply_it_all"], "players.py. It has: play."),
        (["info", "players.py"], "'players.py' is not a recording: it does not begin with 'MMGR' and a version."),
    ],
)
def test_an_error_about_a_wrong_file_says_what_to_do(arguments, sentence):
    done = run(*arguments)
    assert done.exit_code == 1
    assert done.stderr.startswith("gamms: ")
    assert sentence in done.stderr


@pytest.mark.parametrize("option", [["--theme", "dark"], ["--labels"], ["--trails", "3"], ["--no-captions"]])
def test_an_option_of_the_window_without_a_window_is_refused(folder, option):
    run("run", "game.yaml", "--out", "out")
    done = run("replay", "out/game.ggr", *option)
    assert done.exit_code == 2
    assert option[0] in done.stderr
    assert "needs --window" in done.stderr


@pytest.mark.parametrize("option", [["--port", "8000"], ["--host", "::1"], ["--allow-network"], ["--watch"]])
def test_an_option_of_games_in_browsers_without_web_is_refused(option):
    done = run("run", "game.yaml", *option)
    assert done.exit_code == 2
    assert option[0] in done.stderr
    assert "needs --web" in done.stderr


@pytest.mark.parametrize("option", [["--window"], ["--film", "game.mp4"]])
def test_a_game_in_browsers_has_neither_a_window_nor_a_film(option):
    done = run("run", "game.yaml", "--web", *option)
    assert done.exit_code == 2
    assert option[0] in done.stderr
    assert "leave out --web" in done.stderr


def test_a_folder_that_holds_a_recording_and_a_recording_that_is_to_be_played_say_so(folder):
    run("run", "game.yaml", "--out", "out")
    assert "'out' is a folder, not a recording: give the file in it, 'out/game.ggr'." in run("replay", "out").stderr
    assert "`gamms replay` shows recordings" in run("run", "out/game.ggr").stderr


def test_a_wrong_wish_for_a_film_or_picture_is_named(folder):
    run("run", "game.yaml", "--out", "out")
    game = folder / "out" / "game.ggr"
    for arguments, sentence in (
        (["a.avi"], "Cannot write '.avi'; there are: .mp4, .gif, "),
        (["a.png", "--fog", "rde"], "Unknown team 'rde'. Did you mean 'red'?"),
        (["a.mp4", "--follow", "red_7"], "Unknown agent 'red_7'. Did you mean 'red_0'?"),
        (["a.png", "--turns", "40"], "There is no turn 40: "),
    ):
        done = run("render", game, *arguments)
        assert done.exit_code == 1
        assert done.stderr.startswith(f"gamms: {sentence}")
    assert "out/result.json' is not a recording: it does not begin" in run("info", "out/result.json").stderr


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--seed", "abc"], "'--seed': 'abc'"),
        (["--seed=abc"], "'--seed': 'abc'"),
        (["--max-turns", "-1"], "'--max-turns': '-1'"),
        (["--max-turns", "3", "--jobs", "none"], "'--jobs': 'none'"),
        (["--jobs", "2"], "--jobs: 2 games at once need several seeds: add --seeds 0:20"),
    ],
)
def test_invalid_values_of_options_are_named(options, said):
    done = run("run", "game.yaml", *options)
    assert done.exit_code == 2
    assert said in done.stderr


def test_a_film_that_cannot_be_written_leaves_an_earlier_game_as_it_was(folder):
    assert run("run", "game.yaml", "--out", "first").exit_code == 0
    before = (folder / "first" / "game.ggr").read_bytes()
    refused = run("run", "game.yaml", "--out", "first", "--film", "game.avi")
    assert (refused.exit_code, (folder / "first" / "game.ggr").read_bytes()) == (1, before)


def test_a_film_may_be_written_into_the_folder_of_the_game(folder):
    done = run("run", "game.yaml", "--out", "new", "--film", "new/game.gif")
    assert (done.exit_code, (folder / "new" / "game.gif").exists()) == (0, True)


def test_a_long_table_says_how_many_rows_it_leaves_out():
    table = make_rich_table(("number", "square"), [(str(i), str(i * i)) for i in range(1_502)])
    assert [column.justify for column in table.columns] == ["left", "right"]
    assert [*table.columns[0].cells][-2:] == ["499", "and 1,002 more"]
    assert make_rich_table(("number",), [("1",)] * 500).row_count == 500


def test_an_error_and_its_cause_are_printed_without_frames_of_gamms():
    try:
        try:
            gamms.graph.grid(-1, 2)
        except BadValue as error:
            raise ValueError("no such grid") from error
    except ValueError as error:
        said = explain_error(error)
    assert str(Path(gamms.__file__).parent) not in said
    assert said.count(f'File "{__file__}", line') == 2
    assert "BadValue: rows must be at least 1, not -1." in said

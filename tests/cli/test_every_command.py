"""What every command does with nonsense, whatever it is for: a new command is tested here as soon as it is listed."""

import os
import shutil
from contextlib import contextmanager
from inspect import signature
from pathlib import Path
from typing import get_args

import pytest
import typer
from typer.testing import CliRunner

from gamms import cli
from gamms.scenario import gallery

NONSENSE = "n\x1b[31mönsense"
FILES = [
    f"{name}{suffix}"
    for name in ("empty", "junk")
    for suffix in ("", ".yaml", ".json", ".ggr", ".osm", ".gamms", ".csv")
]
WRONG = [*FILES, "nope.yaml", "nope/nope.ggr", "folder", "junk.ggr/x", f"{NONSENSE}.osm"]


def leaves(command, path=()):
    """Yield the names and the command of each command below a group."""
    for name, below in getattr(command, "commands", {}).items():
        yield from leaves(below, (*path, name))
    if not hasattr(command, "commands"):
        yield path, command


COMMANDS = {" ".join(path): command for path, command in leaves(typer.main.get_command(cli.app))}
every_command = pytest.mark.parametrize("name", COMMANDS)


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    """A folder with spaces and umlauts in its name, and files in it that no command can use."""
    place = tmp_path_factory.mktemp("spiele") / "spiele für zwei"
    place.mkdir()
    (place / "folder").mkdir()
    for file in FILES:
        (place / file).write_bytes(bytes(range(256)) if file.startswith("junk") else b"")
    return place


@pytest.fixture(autouse=True)
def _unchanged(place, monkeypatch):
    """Give each command in that folder, and expect it to be left as it was."""
    monkeypatch.chdir(place)
    before = set(place.rglob("*"))
    yield
    assert set(place.rglob("*")) == before


def run(*arguments, **options):
    return CliRunner().invoke(cli.app, list(map(str, arguments)), **options)


def arguments_of(name):
    return [one for one in COMMANDS[name].params if one.param_type_name == "argument"]


def is_number(name, option):
    kind = get_args(signature(COMMANDS[name].callback).parameters[option].annotation)[0]
    return bool({int, float} & {kind, *get_args(kind)})


def failed(done, *named, codes=(1, 2)):
    """Check how a command has failed, and that it names what is wrong."""
    assert done.exit_code in codes, (done.exit_code, done.output, done.exception)
    assert isinstance(done.exception, SystemExit)
    assert "Traceback" not in done.stderr
    assert done.stdout == ""
    assert done.stderr.startswith(("gamms: ", "Usage: ", "Error: ")), done.stderr
    assert "\x1b" not in done.stderr, "what a file or an option holds must not reach the terminal as it is"
    assert all(one in done.stderr for one in named), (named, done.stderr)


@every_command
def test_a_misspelt_option_is_named_as_are_words_too_many(name):
    words = ["x"] * sum(one.nargs for one in arguments_of(name))
    failed(run(*name.split(), *words, "--nonsens"), "--nonsens", codes=(2,))
    if all(one.nargs > 0 for one in arguments_of(name)):
        failed(run(*name.split(), *words, "one-too-many"), "one-too-many", codes=(2,))


@every_command
def test_an_argument_that_is_missing_is_named(name):
    for i, argument in enumerate(one for one in arguments_of(name) if one.required):
        failed(run(*name.split(), *["x"] * i), argument.metavar or argument.name.upper(), codes=(2,))


@every_command
def test_each_option_that_takes_a_value_refuses_none_and_numbers_refuse_words(name):
    words = ["x"] * sum(max(one.nargs, 0) for one in arguments_of(name))
    for option in COMMANDS[name].params:
        if option.param_type_name != "option" or option.is_flag:
            continue
        failed(run(*name.split(), *words, option.opts[0]), option.opts[0], codes=(2,))
        if is_number(name, option.name):
            done = run(*name.split(), *words, option.opts[0], "nonsense")
            failed(done, option.opts[0], "nonsense", codes=(2,))


@every_command
def test_options_of_all_commands_are_checked_before_anything_is_done(name):
    words = ["x"] * sum(max(one.nargs, 0) for one in arguments_of(name))
    failed(run(*name.split(), *words, "--max-memory", NONSENSE), "512M", "önsense", codes=(1,))


@every_command
def test_a_file_that_cannot_be_used_is_named_and_nothing_is_written(name, place):
    arguments = arguments_of(name)
    for wrong in WRONG if arguments else ():
        done = run(*name.split(), *[wrong] * len(arguments))
        if done.exit_code == 0 and "Wrote" in done.stdout:  # a name of something to be made
            shutil.rmtree(place / wrong)
            continue
        failed(done)
        shown = [repr(wrong)[1:-1], wrong.replace("\x1b", "\\u001b"), Path(wrong).name, f"'{Path(wrong).suffix}'"]
        assert any(one in done.stderr for one in shown), (wrong, done.stderr)


@contextmanager
def without_privileges():
    """Let the process be of a user who is not root, who may read everything."""
    is_root = os.geteuid() == 0
    if is_root:
        os.setresuid(65534, 65534, 0)
    try:
        yield
    finally:
        if is_root:
            os.setresuid(0, 0, 0)


@every_command
@pytest.mark.skipif(not hasattr(os, "setresuid"), reason="needs permissions of files")
def test_a_file_that_may_not_be_read_ends_a_command_like_one_that_is_not_there(name, place):
    arguments = arguments_of(name)
    for suffix in (".yaml", ".ggr", ".gamms") if arguments else ():
        locked = place / f"locked{suffix}"
        locked.touch(0o000)
        try:
            missing = run(*name.split(), *[f"nope{suffix}"] * len(arguments))
            with without_privileges():
                done = run(*name.split(), *[locked.name] * len(arguments))
        finally:
            locked.unlink()
        if missing.exit_code == 0:  # a name of something to be made
            shutil.rmtree(place / f"nope{suffix}")
            continue
        failed(done, missing.stderr.split()[0], codes=(missing.exit_code,))  # gamms: or Usage:


@every_command
@pytest.mark.parametrize("charset", ["utf-8", "ascii"])
def test_help_can_be_read_on_a_narrow_terminal_and_in_any_encoding(name, charset):
    done = CliRunner(charset=charset, env={"COLUMNS": "20"}).invoke(cli.app, [*name.split(), "--help"])
    assert (done.exit_code, done.stderr) == (0, "")
    assert name in done.stdout


def test_tables_lose_nothing_on_a_narrow_terminal():
    done = CliRunner(env={"COLUMNS": "20"}).invoke(cli.app, ["gallery"])
    lines = done.stdout.split("\n\n")[0].splitlines()
    assert max(map(len, lines)) <= 20
    names = "".join(line.split("  ")[0].strip() if not line.startswith("  ") else "" for line in lines[1:])
    assert names == "".join(gallery())

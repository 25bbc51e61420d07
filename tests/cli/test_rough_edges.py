"""What commands say where the system fails them: one sentence that names the file, and nothing half written."""

import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from typer.testing import CliRunner

from gamms import cli
from gamms.folders import write_whole

GAME = """
map: {grid: {width: 4, height: 4}}
seed: 1
max_turns: %d
teams:
  red: {count: 2, strategy: "gamms.strategies:random_walk"}
  blü: {count: 1, strategy: "gamms.strategies:random_walk"}
"""


def run(*arguments):
    return CliRunner().invoke(cli.app, list(map(str, arguments)), catch_exceptions=False)


def gamms(*arguments, **options):
    """Start the command line in a process of its own."""
    return subprocess.Popen(
        [sys.executable, *options.pop("flags", ()), "-m", "gamms", *map(str, arguments)],
        stdin=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        **{"stdout": subprocess.PIPE, **options},
    )


def hear_ctrl_c():
    signal.signal(signal.SIGINT, signal.SIG_DFL)


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A folder with a game, a recording, and what is neither, of which each test gets a copy."""
    place = tmp_path_factory.mktemp("made")
    (place / "game.yaml").write_text(GAME % 3, encoding="utf-8")
    (place / "endless.yaml").write_text(GAME % 10_000_000, encoding="utf-8")
    (place / "junk.ggr").write_bytes(b"\x00\x01junk" * 9)
    (place / "binary.yaml").write_bytes(bytes(range(256)))
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(place)
        assert run("run", "game.yaml", "--out", "öut").exit_code == 0
    return place


@pytest.fixture(autouse=True)
def folder(made, tmp_path, monkeypatch):
    """The same in a folder with spaces and umlauts in its name."""
    place = tmp_path / "spiele für zwei"
    shutil.copytree(made, place)
    monkeypatch.chdir(place)
    return place


@pytest.mark.parametrize("suffix", [".svg", ".png", ".pdf", ".html", ".mp4", ".gif"])
@pytest.mark.skipif(not Path("/sys/kernel").is_dir(), reason="needs a folder in which not even root can write")
def test_a_file_that_cannot_be_written_is_named_as_it_was_asked_for(suffix):
    done = run("render", "öut/game.ggr", f"/sys/kernel/picture{suffix}")
    assert done.exit_code == 1
    assert done.stderr.startswith(f"gamms: '/sys/kernel/picture{suffix}': ")
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize("name", ["a.csv", "a.jsonl", "red.ggr"])
def test_a_folder_that_is_not_there_is_named_without_the_name_of_a_temporary_file(name):
    done = run("convert", "öut/game.ggr", f"nope/{name}", *(["--team", "red"] if name == "red.ggr" else []))
    assert done.exit_code == 1
    assert "There is no folder" in done.stderr
    assert ".part" not in done.stderr


@pytest.mark.skipif(not hasattr(signal, "SIGXFSZ"), reason="needs limits on the size of files")
@pytest.mark.parametrize(
    ("name", "named"),
    [("a.png", "a.png"), ("a.html", "a.html"), ("a.gif", "a.gif"), ("a.jsonl", "a.jsonl"), ("a.csv", "a_tracks.csv")],
)
def test_where_there_is_no_room_nothing_half_written_is_left(folder, name, named):
    import resource

    before, limits = signal.signal(signal.SIGXFSZ, signal.SIG_IGN), resource.getrlimit(resource.RLIMIT_FSIZE)
    command = ["convert" if name in ("a.jsonl", "a.csv") else "render", "öut/game.ggr", name]
    was_writing, sys.dont_write_bytecode = sys.dont_write_bytecode, True  # modules would be half written, too
    resource.setrlimit(resource.RLIMIT_FSIZE, (500, limits[1]))
    try:
        done = run(*command)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
        signal.signal(signal.SIGXFSZ, before)
        sys.dont_write_bytecode = was_writing
    assert done.exit_code == 1
    assert done.stderr == f"gamms: '{named}': File too large.\n"
    assert not [path for path in folder.iterdir() if path.name.startswith(("a.", "a_", ".a"))]


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["verify", "junk.ggr"], "'junk.ggr' is not a recording"),
        (["diff", "öut/game.ggr", "junk.ggr"], "'junk.ggr' is not a recording"),
        (["tournament", "binary.yaml"], "binary.yaml: the file is not UTF-8 text"),
        (["run", "game.yaml", "--set", "teams.red.count=[1"], "--set teams.red.count: this is not YAML"),
        (["convert", "öut/game.ggr", "a.csv", "--turn-seconds", "1e300"], "turn_seconds must let a game end within"),
        (["convert", "track.gpx", "a.ggr"], "The tracks in 'track.gpx' are matched to the roads of a map: give --map"),
    ],
)
def test_an_error_names_the_file_or_option_that_it_is_about(arguments, said, folder):
    before = set(folder.rglob("*"))
    done = run(*arguments)
    assert done.exit_code == 1
    assert done.stderr.startswith(f"gamms: {said}")
    assert set(folder.rglob("*")) == before


@pytest.mark.parametrize(
    "command",
    [
        ("run", "game.yaml", "--out", "new/r", "--film", "f.xyz"),
        ("run", "game.yaml", "--out", "new/r", "--strategy", "nope=gamms.strategies:stay"),
        ("run", "game.yaml", "--out", "new/r", "--web", "--port", "99999"),
        (
            "run",
            "game.yaml",
            "--out",
            "new/r",
            "--seeds",
            "0:2",
            "--jobs",
            "1",
            "--strategy",
            "nope=gamms.strategies:stay",
        ),
        ("study", "visit.yaml", "--out", "new/r", "--port", "99999"),
        ("study", "visit.yaml", "--out", "new/r", "--host", "8.8.8.8"),
        ("tournament", "cup.yaml", "--out", "new/r"),
        ("suite", "scripted", "--out", "new/r", "--only", "nope"),
        ("suite", "references", "--out", "new/r", "--only", "nope"),
        ("gallery", "grid_tag", "--page", "game.yaml"),
        ("diff", "öut/game.ggr", "öut/game.ggr", "--html", "öut/game.ggr"),
        ("map", "game.yaml", "--out", "game.yaml"),
        ("render", "öut/game.ggr", "öut/game.ggr"),
        ("convert", "öut/game.ggr", "öut/game.ggr", "--team", "red"),
    ],
    ids=" ".join,
)
def test_a_command_that_is_refused_leaves_no_folder_and_no_file_changed(folder, command):
    (folder / "visit.yaml").write_text("scenario: game.yaml\nconsent: consent.txt\npeople: red_0\n")
    (folder / "consent.txt").write_text("Do you agree?")
    (folder / "cup.yaml").write_text("scenario: game.yaml\nentries: {a: game.yaml, b: game.yaml}\nseeds: 2\n")
    before = {path: path.is_file() and path.read_bytes() for path in folder.rglob("*")}
    done = run(*command)
    assert done.exit_code == 1
    assert done.stderr.startswith("gamms: ")
    assert {path: path.is_file() and path.read_bytes() for path in folder.rglob("*")} == before


@pytest.mark.skipif(not Path("/dev/fd").is_dir(), reason="needs names of open files")
def test_a_device_or_a_pipe_is_written_to_and_no_file_takes_its_place():
    reading, writing = os.pipe()
    with os.fdopen(reading, "rb") as end:
        with os.fdopen(writing, "wb"):
            write_whole(Path(f"/dev/fd/{writing}"), b"a page", through_links=True)
        assert end.read() == b"a page"


@pytest.mark.skipif(os.name == "nt", reason="no folder is deleted there while a program is in it")
def test_a_folder_that_is_deleted_while_one_is_in_it_is_named_as_the_trouble(folder, monkeypatch):
    game = folder.absolute() / "game.yaml"
    (folder / "gone").mkdir()
    monkeypatch.chdir("gone")
    Path("../gone").rmdir()
    done = run("run", game)
    os.chdir(folder)
    assert done.exit_code == 1
    assert done.stderr == "gamms: The current folder is not there any more: change into another one.\n"


@pytest.mark.skipif(os.name == "nt", reason="pipes end differently there")
def test_a_reader_that_has_enough_ends_a_command_without_a_word():
    reading, writing = os.pipe()
    os.close(reading)
    with gamms("info", "öut/game.ggr", stdout=writing) as process:
        os.close(writing)
        said = process.communicate()[1]
    assert process.returncode == 1
    assert said == b""


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs an output that is full")
@pytest.mark.parametrize("command", [("--version",), ("info", "öut/game.ggr")], ids=" ".join)
def test_an_output_that_is_full_is_a_failure_in_one_sentence(command):
    with Path("/dev/full").open("wb") as full, gamms(*command, stdout=full) as process:
        said = process.communicate()[1]
    assert process.returncode == 1
    assert said.decode().splitlines() == ["gamms: No space left on device, while something was read or written."]


INTERRUPTED_EARLY = """
import os, signal, sys

class Interrupts:
    def find_spec(self, name, path, target=None):
        if name == "gamms.cli.play":
            exec("os.kill(os.getpid(), signal.SIGINT)", globals())  # of a text, as that of a dataclass

sys.meta_path.insert(0, Interrupts())
"""


@pytest.mark.skipif(os.name == "nt", reason="Ctrl-C is another signal there")
def test_ctrl_c_ends_a_command_with_a_word_before_it_is_loaded(folder, monkeypatch):
    (folder / "sitecustomize.py").write_text(INTERRUPTED_EARLY)
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(folder), os.environ.get("PYTHONPATH", "")]))
    with gamms("--version", preexec_fn=hear_ctrl_c) as process:
        said = process.communicate()[1]
    assert (process.returncode, said) == (130, b"gamms: Interrupted.\n")


@pytest.mark.skipif(os.name == "nt", reason="Ctrl-C is another signal there")
@pytest.mark.parametrize(
    ("more", "number"),
    [((), signal.SIGINT), (("--seeds", "0:4", "--jobs", "2"), signal.SIGINT), ((), signal.SIGTERM)],
    ids=["one game", "many", "terminated"],
)
def test_ctrl_c_ends_games_with_a_word_and_leaves_a_recording_that_can_be_read(folder, more, number):
    # In a background job SIGINT is ignored, and children inherit that.
    with gamms(
        "run", "endless.yaml", "--out", "long", *more, start_new_session=True, preexec_fn=hear_ctrl_c
    ) as process:
        waited_for = folder / "long" / ("" if more else "game.ggr")
        sizes = set()  # a recording that has only begun is taken away again
        while len(sizes) < (1 if more else 2):
            assert process.poll() is None
            sizes |= {waited_for.stat().st_size} - {0} if waited_for.exists() else set()
            time.sleep(0.02)
        os.killpg(process.pid, number)
        said = process.communicate(timeout=60)[1].decode()
    assert process.returncode == 130
    assert said.strip() == "gamms: Interrupted."
    assert more or run("info", "long/game.ggr").exit_code == 0


@pytest.mark.skipif(os.name == "nt", reason="a locale of Unix")
@pytest.mark.parametrize("command", [("run", "game.yaml", "--out", "öut"), ("replay", "öut/game.ggr")], ids=" ".join)
def test_commands_work_in_a_narrow_terminal_without_utf_8_without_a_home_and_with_warnings_as_errors(command):
    clean = {name: os.environ[name] for name in ("PATH", "PYTHONPATH") if name in os.environ}
    strict = {**clean, "LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONIOENCODING": "ascii", "COLUMNS": "20"}
    with gamms(*command, env=strict, flags=["-W", "error"]) as process:
        printed, said = process.communicate()
    assert (process.returncode, said) == (0, b"")
    assert rb"bl\xfc" in printed or "blü".encode() in printed

"""Folders of results from strangers: damaged files end in an error of ours, and nothing is written elsewhere."""

import json
import os
import shutil
import socket
import subprocess
import sys
import threading
import tracemalloc
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gamms import experiment, folders, limits, recorder, scenario, tournament, web
from gamms.errors import BadFile, GammsError, TooLarge, WriteConflict
from gamms.game import Result
from gamms.scenario import Scenario
from gamms.tournament.entries import find_entries

pytestmark = pytest.mark.skipif(os.name != "posix", reason="pipes, links and devices of POSIX")

TEAM = {"agents": [{"name": "ann", "node": 0}], "strategy": "gamms.strategies:stay"}
OTHER = {"agents": [{"name": "bob", "node": 2}], "strategy": "gamms.strategies:stay"}
GAME = Scenario(map={"grid": {"width": 3, "height": 1}}, teams={"a": TEAM, "b": OTHER}, max_turns=1)
VARY = {"max_turns": [1, 2]}
PLAY = "def play(state):\n    state['action'] = state['curr_pos']\n"
LINES = [
    {"participant": "x", "number": 0, "secret": "0" * 64},
    {"group": 0, "condition": "all", "members": ["x"]},
    {"group": 0, "played": 0, "attempt": 1},
]


def entries_in(folder):
    for name in ("one", "two"):
        (folder / name).mkdir(exist_ok=True)
        (folder / name / "play.py").write_text(PLAY)
    return {name: f"{folder / name / 'play.py'}:play" for name in ("one", "two")}


# -- a folder of each kind: how it is made, and all that reads it -----------------------------------------------------


def make_experiment(folder):
    experiment.run(GAME, [1, 2], VARY, out=folder, shard=(1, 1))
    experiment.merge(folder)


def read_experiment(folder):
    experiment.load(folder / "shard-1-of-1").summary()
    experiment.merge(folder)
    rows = experiment.run(GAME, [1, 2], VARY, out=folder)
    rows.table()
    rows.summary()
    rows.compare("turns", "max_turns")


def make_study(folder):
    read_study(folder)
    folders.add_lines(folder / "participants.jsonl", LINES)
    folders.add_lines(folder / "rows.jsonl", [{"participant": "x", "turns": 1}])


def read_study(folder):
    with web.study(GAME, consent="Yes?", out=folder, people="a", practice=0) as study:
        study.assigned.values()
        study._write_csv()
        study._known.groups[0:1] and study.release("x")


def make_tournament(folder):
    read_tournament(folder)


def read_tournament(folder):
    entries = entries_in(folder.parent)
    table = tournament.run(GAME, entries=entries, seeds=[1], out=folder, record=False, move_seconds=20.0)
    table.payoffs()


def make_entries(folder):
    entries_in(folder)


def read_entries(folder):
    given = {name: f"{folder / name / 'play.py'}:play" for name in ("one", "two")}
    find_entries(given, folder, folder / "out", [])


KINDS = {
    "experiment": (
        make_experiment,
        read_experiment,
        ["shard-1-of-1/experiment.json", "shard-1-of-1/journal.jsonl", "journal.jsonl"],
    ),
    "study": (make_study, read_study, ["study.jsonl", "participants.jsonl", "rows.jsonl"]),
    "tournament": (make_tournament, read_tournament, ["tournament.json", "journal.jsonl"]),
    "entries": (make_entries, read_entries, ["one/weights"]),
}
FILES = [(kind, name) for kind, (_, _, names) in KINDS.items() for name in names]


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A folder of each kind, as its program leaves it."""
    folder = tmp_path_factory.mktemp("made")
    for kind, (make, _, _) in KINDS.items():
        (folder / kind).mkdir()
        make(folder / kind)
    return folder


def ends_well(kind, folder):
    """Return whether a folder is read without an error of ours or of the system."""
    try:
        KINDS[kind][1](folder)
    except (GammsError, OSError):
        return False
    return True


# -- whole files in the place of others -------------------------------------------------------------------------------

DEEP, LONG = 100_000, 10**400
TEXTS = {
    "nothing": "",
    "zero bytes": "\0" * 100,
    "null": "null\n",
    "a number": "5\n",
    "a list": "[]\n",
    "an object": "{}\n",
    "deep lists": "[" * DEEP + "\n",
    "closed deep lists": "[" * DEEP + "]" * DEEP + "\n",
    "lists of 900 levels": '{"id": ' + "[" * 900 + "]" * 900 + "}\n",
    "deep objects": '{"id":' * DEEP + "\n",
    "a long integer": f'{{"id": "a", "participant": "x", "seed": {LONG}, "turns": {LONG}, "played": {LONG}}}\n',
    "a longer integer": '{"id": ' + "9" * 5_000 + "}\n",
    "half a pair": '{"id": "\\ud800", "participant": "\\ud800", "number": 0, "secret": "\\ud800"}\n',
    "NaN": '{"id": NaN}\n',
    "other members": '{"group": 0, "condition": "all", "members": 5}\n',
    "no such group": '{"group": -1, "played": 1, "attempt": 1}\n',
    "no plan": '{"format": "gamms experiment 1"}\n',
    "rows that are no list": '{"format": "gamms experiment 1", "rows": 5, "keys": [[1]]}\n',
}


@pytest.mark.parametrize("text", TEXTS.values(), ids=TEXTS)
@pytest.mark.parametrize(("kind", "name"), [one for one in FILES if one[0] != "entries"])
def test_another_text_in_the_place_of_a_file_is_refused(made, tmp_path, kind, name, text):
    shutil.copytree(made / kind, tmp_path / kind)
    (tmp_path / kind / name).write_text(text)
    ends_well(kind, tmp_path / kind)


def pipe(path, _):
    os.mkfifo(path)


def a_socket(path, _):
    here = Path.cwd()
    os.chdir(path.parent)  # a socket's path is short
    try:
        with socket.socket(socket.AF_UNIX) as one:
            one.bind(path.name)
    finally:
        os.chdir(here)


def link_to_zeros(path, _):
    path.symlink_to("/dev/zero")


def link_to_a_file(path, elsewhere):
    path.symlink_to(elsewhere)


def link_to_nothing(path, elsewhere):
    path.symlink_to(elsewhere.with_name("new"))


def folder(path, _):
    path.mkdir()


@pytest.mark.parametrize("put", [pipe, a_socket, link_to_zeros, link_to_a_file, link_to_nothing, folder])
@pytest.mark.parametrize(
    ("kind", "name"),
    [*FILES, *((kind, "lock") for kind in ("experiment", "study", "tournament")), ("entries", "one/weights")],
)
def test_a_path_that_is_not_a_file_is_refused_at_once_and_never_written(made, tmp_path, kind, name, put):
    elsewhere = tmp_path / "mine"
    elsewhere.write_text("mine")
    shutil.copytree(made / kind, tmp_path / kind)
    place = tmp_path / kind / name
    place.unlink(missing_ok=True)
    put(place, elsewhere)
    is_good = ends_well(kind, tmp_path / kind)
    assert is_good == (kind == "entries" and put in (link_to_zeros, link_to_a_file, link_to_nothing, folder))
    assert elsewhere.read_text() == "mine"
    assert not (tmp_path / "new").exists()


@pytest.mark.parametrize("read", [Result.load, scenario.load, recorder.open], ids=["result", "scenario", "recording"])
def test_a_pipe_in_the_place_of_a_file_is_refused_at_once(tmp_path, read):
    file = tmp_path / "game.yaml"
    os.mkfifo(file)
    with pytest.raises(GammsError, match="pipe"):
        read(file)


RESULTS = {
    "experiment": ["rows.jsonl", "rows.csv", "experiment.json"],
    "study": ["rows.csv"],
    "tournament": ["map.gamms", "index.html", "tournament.json"],
}


@pytest.mark.parametrize(("kind", "name"), [(kind, name) for kind in RESULTS for name in RESULTS[kind]])
def test_a_link_in_the_place_of_a_result_is_replaced(made, tmp_path, kind, name):
    elsewhere = tmp_path / "mine"
    elsewhere.write_text("mine")
    shutil.copytree(made / kind, tmp_path / kind)
    place = tmp_path / kind / name
    place.unlink()
    place.symlink_to(elsewhere)
    assert ends_well(kind, tmp_path / kind) == (name != "tournament.json")
    assert elsewhere.read_text() == "mine"


@pytest.mark.parametrize(
    ("kind", "name"),
    [("experiment", "shard-1-of-1"), ("study", "games"), ("tournament", "games"), ("tournament", "logs")],
)
def test_a_folder_within_the_results_is_no_link(made, tmp_path, kind, name):
    shutil.copytree(made / kind, tmp_path / kind)
    shutil.rmtree(tmp_path / kind / name, ignore_errors=True)
    (tmp_path / "mine").mkdir()
    (tmp_path / kind / name).symlink_to(tmp_path / "mine")
    with pytest.raises(BadFile, match=f"{name}' must be a folder, and it is a link"):
        make_experiment(tmp_path / kind) if kind == "experiment" else KINDS[kind][1](tmp_path / kind)
    assert list((tmp_path / "mine").iterdir()) == []


@pytest.mark.parametrize("line", ['{"id":"1"}', '{"id":"1","a":[' + "[]," * 99 + "[]]}", '{"id":"' + "x" * 900 + '"}'])
def test_a_file_of_lines_takes_no_more_memory_than_is_allowed(tmp_path, line):
    file = tmp_path / "journal.jsonl"
    file.write_text(f"{line}\n" * (300_000 // len(line)))
    with limits.allowing("200k"), pytest.raises(TooLarge, match="--max-memory 8G"):
        folders.read_json_lines(file, "a row")
    tracemalloc.start()
    try:
        folders.read_json_lines(file, "a row")
        taken = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    with limits.allowing(taken // 2), pytest.raises(TooLarge):
        folders.read_json_lines(file, "a row")


# -- one value in the place of another -------------------------------------------------------------------------------

VALUES = st.recursive(
    st.none()
    | st.booleans()
    | st.sampled_from([0, -1, 3, 1 << 64, LONG, 1e308, float("inf"), "", "a", "\ud800", "=1", [[[1]]], {"a": []}])
    | st.text(max_size=3),
    lambda inner: st.lists(inner, max_size=2) | st.dictionaries(st.text(max_size=2), inner, max_size=2),
    max_leaves=4,
)


def replaced(document, choose):
    """Return a document in which one value, chosen anywhere, is another one or has gone."""
    if isinstance(document, dict) and document and choose.draw(st.integers(0, 3)):
        key = choose.draw(st.sampled_from(sorted(document)))
        if choose.draw(st.integers(0, 3)) == 0:
            return {name: value for name, value in document.items() if name != key}
        return {**document, key: replaced(document[key], choose)}
    if isinstance(document, list) and document and choose.draw(st.integers(0, 3)):
        place = choose.draw(st.integers(0, len(document) - 1))
        return [*document[:place], replaced(document[place], choose), *document[place + 1 :]]
    return choose.draw(VALUES)


@pytest.mark.parametrize(("kind", "name"), [one for one in FILES if one[0] in ("experiment", "study")])
@pytest.mark.filterwarnings("ignore::RuntimeWarning")  # of means of 1e308
@given(choose=st.data())
def test_another_value_anywhere_is_used_or_refused(made, tmp_path_factory, kind, name, choose):
    place = tmp_path_factory.mktemp("damaged") / kind
    shutil.copytree(made / kind, place)
    text = (place / name).read_text()
    documents = [json.loads(line) for line in text.splitlines()] if name.endswith("l") else [json.loads(text)]
    number = choose.draw(st.integers(0, len(documents) - 1))
    documents[number] = replaced(documents[number], choose)
    (place / name).write_text("".join(f"{json.dumps(one)}\n" for one in documents))
    ends_well(kind, place)


@given(choose=st.data())
def test_another_value_in_the_row_of_a_tournament_is_used_or_refused(made, choose):
    rows = [json.loads(line) for line in (made / "tournament" / "journal.jsonl").read_text().splitlines()]
    text = json.dumps(replaced(rows[0], choose))
    place = made / "row.jsonl"
    place.write_text(f"{text}\n")
    try:
        rows = folders.read_json_lines(place, "a row", tournament.games.Row)
    except BadFile:
        return
    json.dumps(rows).encode()


# -- unfinished files -------------------------------------------------------------------------------------------------


def test_writers_of_one_file_at_a_time_do_not_disturb_each_other(tmp_path):
    file = tmp_path / "table.csv"
    with folders.open_whole_file(file) as first:
        first.write_text("first")
        with folders.open_whole_file(file) as second:
            assert second != first
            second.write_text("second")
        assert file.read_text() == "second"
        assert first.read_text() == "first"
        with folders.open_whole_file(file) as third:
            third.write_text("third")
    assert file.read_text() == "first"
    assert [*tmp_path.iterdir()] == [file]


def test_the_rest_of_a_killed_writer_is_replaced_with_its_permissions(tmp_path):
    file = tmp_path / "table.csv"
    rest = tmp_path / ".table.csv.part"
    rest.write_text("a very long rest")
    rest.chmod(0o600)
    with folders.open_whole_file(file) as beside:
        assert beside == rest
        assert beside.read_text() == ""
        beside.write_text("new")
    (tmp_path / "usual").write_text("")
    assert file.read_text() == "new"
    assert file.stat().st_mode == (tmp_path / "usual").stat().st_mode
    assert {one.name for one in tmp_path.iterdir()} == {"table.csv", "usual"}


@pytest.mark.parametrize("put", ["link", "folder", "pipe"])
def test_something_else_in_the_place_of_an_unfinished_file_is_left_alone(tmp_path, put):
    file = tmp_path / "table.csv"
    rest = tmp_path / ".table.csv.part"
    if put == "link":
        rest.symlink_to(tmp_path / "elsewhere")
    elif put == "folder":
        rest.mkdir()
    else:
        os.mkfifo(rest)
    with folders.open_whole_file(file) as beside:
        beside.write_text("new")
    assert file.read_text() == "new"
    assert not (tmp_path / "elsewhere").exists()
    assert {one.name for one in tmp_path.iterdir()} == {"table.csv", ".table.csv.part"}


def test_after_an_error_a_file_is_unchanged_and_nothing_is_beside_it(tmp_path):
    file = tmp_path / "table.csv"
    file.write_text("old")
    with pytest.raises(RuntimeError), folders.open_whole_file(file) as beside:
        beside.write_text("new")
        raise RuntimeError
    with (
        pytest.raises(FileNotFoundError, match=r"no folder '.*none' to write 'x\.csv' into"),
        folders.open_whole_file(tmp_path / "none" / "x.csv") as beside,
    ):
        beside.write_text("new")
    assert file.read_text() == "old"
    assert [*tmp_path.iterdir()] == [file]


# -- locks --------------------------------------------------------------------------------------------------------


def test_one_of_the_threads_that_lock_a_folder_at_once_gets_it(tmp_path):
    holders = []
    rounds = []
    begin = threading.Barrier(4, timeout=20)
    end = threading.Barrier(4, action=lambda: rounds.append(len(holders)) or holders.clear(), timeout=20)

    def lock():
        for _ in range(300):
            begin.wait()
            with suppress(WriteConflict), folders.lock_folder(tmp_path):
                holders.append(1)
                end.wait()
                continue
            end.wait()

    before = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    try:
        with ThreadPoolExecutor(4) as pool:
            for done in [pool.submit(lock) for _ in range(4)]:
                done.result()
    finally:
        sys.setswitchinterval(before)
    assert rounds == [1] * 300


def test_a_folder_is_locked_by_any_of_its_names_and_others_are_free(tmp_path):
    folder = tmp_path / "rows"
    folder.mkdir()
    (tmp_path / "link").symlink_to(folder, target_is_directory=True)
    with folders.lock_folder(folder):
        for name in (folder, tmp_path / "link", folder / ".." / "rows"):
            with pytest.raises(WriteConflict, match="Another run is writing into"), folders.lock_folder(name):
                pass
        assert [one.name for one in folder.iterdir()] == ["lock"]
        with folders.lock_folder(tmp_path / "others"):
            pass
    assert list(folder.iterdir()) == []


def test_a_refused_lock_leaves_that_of_the_holder_to_other_processes(tmp_path):
    program = (
        "import sys; from pathlib import Path; from gamms.folders import *\nwith lock_folder(Path(sys.argv[1])): pass"
    )
    with folders.lock_folder(tmp_path):
        with pytest.raises(WriteConflict), folders.lock_folder(tmp_path):
            pass  # or its end would unlock the file for all
        done = subprocess.run([sys.executable, "-c", program, tmp_path], capture_output=True, text=True, check=False)
    assert "WriteConflict" in done.stderr


@pytest.mark.parametrize("ends_with", [KeyboardInterrupt, ValueError, None])
def test_a_folder_is_free_again_however_its_holder_ends(tmp_path, ends_with):
    with suppress(KeyboardInterrupt, ValueError), folders.lock_folder(tmp_path):
        if ends_with is not None:
            raise ends_with
    with folders.lock_folder(tmp_path):
        assert (tmp_path / "lock").is_file()


def test_a_folder_that_could_not_be_locked_can_be_locked_later(tmp_path):
    (tmp_path / "rows").write_text("a file")
    with pytest.raises(GammsError), folders.lock_folder(tmp_path / "rows"):
        pass
    (tmp_path / "rows").unlink()
    with folders.lock_folder(tmp_path / "rows"):
        pass

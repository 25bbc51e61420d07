"""What a run keeps on disk: resumed after a crash, in shards, and refused to a second run."""

import csv
import json
import os
import shutil
import signal
import subprocess
import sys

import pytest
from small_hunts import HUNT

from gamms import experiment
from gamms.errors import BadFile, BadValue, WriteConflict
from gamms.experiment import folders
from gamms.folders import lock_folder
from gamms.scenario import Scenario

VARY = {"teams.red.count": [1, 2]}


def files_in(folder):
    return {path.name: path.read_bytes() for path in folder.glob("rows.*")}


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """The folder of a run that was not interrupted."""
    folder = tmp_path_factory.mktemp("whole")
    experiment.run(HUNT, range(4), VARY, out=folder)
    return folder


def test_the_files_have_the_rows_in_the_order_of_the_plan(whole):
    rows = list(experiment.load(whole))
    assert [json.loads(line) for line in (whole / "rows.jsonl").read_text().splitlines()] == rows
    with (whole / "rows.csv").open(newline="") as file:
        table = list(csv.DictReader(file))
    assert [line["id"] for line in table] == [row["id"] for row in rows]
    assert table[0]["turns"] == str(rows[0]["turns"])
    assert list(table[0])[:8] == ["id", "scenario", "gamms", "python", "numpy", "teams.red.count", "seed", "reason"]


def test_parquet_has_the_same_rows(whole):
    parquet = pytest.importorskip("pyarrow.parquet")
    rows = list(experiment.load(whole))
    assert parquet.read_table(whole / "rows.parquet").to_pylist() == rows


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere the names of files are text")
def test_a_folder_whose_name_is_no_text_gets_the_same_files(whole, tmp_path):
    folder = tmp_path / os.fsdecode(b"\xff")
    experiment.run(HUNT, range(4), VARY, out=folder)
    assert files_in(folder) == files_in(whole)


def test_a_run_without_pyarrow_ends_without_that_file(tmp_path, monkeypatch):
    monkeypatch.setattr(folders, "find_spec", lambda name: None)
    experiment.run(HUNT, range(2), out=tmp_path)
    assert sorted(files_in(tmp_path)) == ["rows.csv", "rows.jsonl"]


@pytest.mark.parametrize("share", [0.0, 0.1, 0.5, 0.77, 0.999])
def test_a_journal_that_was_cut_anywhere_is_resumed(whole, tmp_path, share):
    journal = (whole / "journal.jsonl").read_bytes()
    (tmp_path / "journal.jsonl").write_bytes(journal[: int(share * len(journal))])
    experiment.run(HUNT, range(4), VARY, out=tmp_path)
    assert files_in(tmp_path) == files_in(whole)
    assert sorted((tmp_path / "journal.jsonl").read_bytes().splitlines()) == sorted(journal.splitlines())


def test_games_that_have_rows_are_not_played_again(whole, tmp_path):
    journal = (whole / "journal.jsonl").read_text().replace('"turns": ', '"turns": 9')
    (tmp_path / "journal.jsonl").write_text(journal)
    assert all(str(row["turns"])[0] == "9" for row in experiment.run(HUNT, range(4), VARY, out=tmp_path))


def test_more_seeds_go_on_in_the_same_folder(whole, tmp_path):
    experiment.run(HUNT, range(1, 3), VARY, out=tmp_path)
    experiment.run(HUNT, range(4), VARY, out=tmp_path)
    assert files_in(tmp_path) == files_in(whole)


def test_other_code_is_another_game(tmp_path):
    (tmp_path / "players.py").write_text("def stay(state):\n    state['action'] = state['curr_pos']\n")
    raw = HUNT.to_dict()
    raw["teams"]["red"]["strategy"] = "players:stay"
    first, again = (experiment.run(Scenario(folder=tmp_path, **raw), [1])[0]["id"] for _ in range(2))
    (tmp_path / "players.py").write_text("def stay(state):\n    state['action'] = state['legal'][-1]\n")
    assert first == again != experiment.run(Scenario(folder=tmp_path, **raw), [1])[0]["id"]


def test_rows_of_another_version_are_not_mixed_in(whole, tmp_path):
    journal = (whole / "journal.jsonl").read_text()
    (tmp_path / "journal.jsonl").write_text(journal.replace('"gamms": "2', '"gamms": "1'))
    with pytest.raises(WriteConflict, match=r"played by gamms 1\.0\.0rc1: choose another folder"):
        experiment.run(HUNT, range(4), VARY, out=tmp_path)


def test_a_line_that_is_no_row_is_named(tmp_path):
    (tmp_path / "journal.jsonl").write_text('{"id": "a"}\nnonsense\n')
    with pytest.raises(BadFile, match=r"line 1, is not a row: .* `scenario`.* Delete the line"):
        experiment.run(HUNT, [1], out=tmp_path)


def test_a_row_without_a_winner_counts_in_no_rate_of_wins(whole, tmp_path):
    shutil.copytree(whole, tmp_path / "altered")
    journal = tmp_path / "altered" / "journal.jsonl"
    journal.write_text(journal.read_text().replace('"winner":', '"wimner":', 1))
    assert sorted(experiment.load(tmp_path / "altered").summary(metrics=["wins.red"])["seeds"].tolist()) == [3, 4]


def test_shards_are_merged_into_the_files_of_one_run(whole, tmp_path):
    for shard in ((1, 3), (2, 3), "3/3"):
        rows = experiment.run(HUNT, range(4), VARY, out=tmp_path, shard=shard)
        assert len(rows) in (2, 3)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["shard-1-of-3", "shard-2-of-3", "shard-3-of-3"]
    experiment.merge(tmp_path)
    assert files_in(tmp_path) == files_in(whole)
    assert list(experiment.load(tmp_path)) == list(experiment.load(whole))


def test_shards_that_are_not_whole_or_not_of_one_experiment_are_refused(tmp_path):
    experiment.run(HUNT, range(4), out=tmp_path, shard=(1, 2))
    with pytest.raises(BadValue, match=r"2 of 4 games are missing, such as .\w+.: run all shards"):
        experiment.merge(tmp_path)
    experiment.run(HUNT, range(5), out=tmp_path, shard=(2, 2))
    with pytest.raises(BadValue, match="different experiments: their seeds differ"):
        experiment.merge(tmp_path)
    with pytest.raises(BadValue, match="no folders"):
        experiment.merge(tmp_path / "nowhere")
    for shard in ((0, 2), (3, 2), "1", "a/b", 5):
        with pytest.raises(BadValue, match="third of 20"):
            experiment.run(HUNT, [1], out=tmp_path, shard=shard)
    with pytest.raises(BadValue, match="A shard needs out"):
        experiment.run(HUNT, [1], shard=(1, 2))


def test_a_second_run_in_a_folder_is_refused(tmp_path):
    with lock_folder(tmp_path), pytest.raises(WriteConflict, match="Another run is writing"):
        experiment.run(HUNT, [1], out=tmp_path)
    assert list(tmp_path.iterdir()) == []
    assert len(experiment.run(HUNT, [1], out=tmp_path)) == 1
    assert "lock" not in {file.name for file in tmp_path.iterdir()}


def test_a_run_that_is_refused_leaves_no_folder(tmp_path):
    with pytest.raises(BadValue, match="cannot be sent"):
        experiment.run(HUNT, [1], out=tmp_path / "a" / "b", workers=1, collect={"turns": lambda result: result.turns})
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("out", ["file", "file/of/rows"])
def test_a_file_in_the_place_of_the_folder_is_named(out, tmp_path):
    (tmp_path / "file").write_text("mine")
    with pytest.raises(BadValue, match=r"There is '.*file' already, and it is not a folder"):
        experiment.run(HUNT, [1], out=tmp_path / out)
    assert (tmp_path / "file").read_text() == "mine"


PROGRAM = """
import sys, time
from pathlib import Path
from gamms.experiment import folders
from gamms.folders import lock_folder
with lock_folder(Path(sys.argv[1])):
    print("locked", flush=True)
    time.sleep(60)
"""


@pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="signals of POSIX")
def test_a_process_that_was_killed_keeps_no_folder(tmp_path):
    other = subprocess.Popen([sys.executable, "-c", PROGRAM, tmp_path], stdout=subprocess.PIPE)
    assert other.stdout.readline() == b"locked\n"
    with pytest.raises(WriteConflict):
        experiment.run(HUNT, [1], out=tmp_path)
    other.kill()
    other.wait()
    other.stdout.close()
    assert len(experiment.run(HUNT, [1], out=tmp_path)) == 1
